import hashlib
import json
import os
import sys
import time
from dataclasses import dataclass, replace
from statistics import median

import numpy as np
import pytest
from hypothesis import settings
from safetensors.numpy import save

from bench.renderer import renderer

# To be set before MuJoCo is imported.
os.environ["MUJOCO_GL"] = renderer() or ""

from bench import driver
from bench.backend import Workers
from bench.cli import main
from bench.controller import ControllerConfig
from bench.packed import pack
from bench.presets import PRESETS
from bench.results import Results
from tasks import demos, experts
from tasks.data import FloatArray, generator
from tasks.registry import TASKS, get_task
from tasks.simulator import Simulator

# No deadline, since the machine may be busy; fixed examples, so that tests are repeatable.
settings.register_profile("suite", deadline=None, derandomize=True)
settings.load_profile("suite")


def pytest_addoption(parser):
    parser.addoption("--times", type=int, default=1, help="how often each kind of damage is tried")


@pytest.fixture
def times(request):
    return request.config.getoption("--times")


FIGURES: dict[str, list[float]] = {}


@pytest.fixture
def figure(request):
    """Records a number for the summary of `make reliability`."""

    def note(name: str, value: float) -> None:
        FIGURES.setdefault(f"{request.node.name}: {name}", []).append(value)

    return note


def pytest_terminal_summary(terminalreporter, config):
    if config.getoption("--times") == 1:
        return
    terminalreporter.section("figures")
    for name, values in FIGURES.items():
        shown = f"{values[0]:g}"
        if len(values) > 1:
            shown = f"median {median(values):.2g}, most {max(values):.2g}, n = {len(values)}"
        terminalreporter.write_line(f"{name} {shown}")


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    """Even on a busy machine, no command prints what it is doing."""
    monkeypatch.setattr("bench.doing.MOMENT", 1e9)


@pytest.fixture
def ends_within():
    """Returns whether all processes of a group end within some seconds."""

    def wait(seconds: float, group: int) -> bool:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            try:
                os.killpg(group, 0)
            except ProcessLookupError:
                return True
            time.sleep(0.1)
        return False

    return wait


@pytest.fixture
def files_of():
    """The SHA-256 of the files of a results folder that every run of the same study repeats."""

    def hashes(folder):
        kinds = ("*.parquet", "weights.safetensors", "tables/*", "figures/*")
        return {
            str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
            for kind in kinds
            for path in folder.rglob(kind)
            if not {"damaged", ".unfinished"} & set(path.parts) and "_time" not in path.name
        }

    return hashes


@pytest.fixture(params=TASKS)
def task(request):
    return get_task(request.param)


@dataclass
class Replay:
    """A policy that plays back actions (N, T-1, A), one row for each start index."""

    actions: FloatArray

    def reset(self, simulator: Simulator) -> None:
        self.rows = simulator.starts.index

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        return self.actions[self.rows, step]


@pytest.fixture
def random_replay():
    """Makes a Replay of smooth random actions, which move the hand and the object."""

    def make(task, n: int, steps: int | None = None) -> Replay:
        return Replay(random_actions(task, n, steps))

    return make


def random_actions(task, n: int, steps: int | None = None) -> FloatArray:
    steps = task.horizon - 1 if steps is None else steps
    rng = generator("test actions", task.name)
    noise = rng.standard_normal((n, steps, task.layout.action_dim))
    return 0.3 * noise.cumsum(axis=1)


@pytest.fixture
def shipped(task, tmp_path, monkeypatch):
    """Ships a small random expert for the task; every third episode fails."""
    monkeypatch.setattr(experts, "SHIPPED", tmp_path / "experts")
    monkeypatch.setenv("BENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(demos, "TRAINING", 6)
    monkeypatch.setattr(demos, "VALIDATION", 2)
    monkeypatch.setattr("tasks.recorder.BLOCK", 5)
    monkeypatch.setattr(type(task), "horizon", 6)
    monkeypatch.setattr(type(task), "success", lambda self, r: np.arange(len(r)) % 3 != 0)
    monkeypatch.setattr("bench.backend.Workers", in_this_process)
    return ship(task, tmp_path / "experts", "first")


@pytest.fixture
def two_shipped(task, shipped, tmp_path):
    """Ships a second small random expert beside the first."""
    return ship(task, tmp_path / "experts", "second")


def in_this_process(jobs, backend="loky", *options):
    """Workers that run a single job in this process, where the patches of a test apply."""
    alone = jobs == 1 and backend == "loky"
    return Workers(jobs, "sequential" if alone else backend, *options)


@pytest.fixture
def smoke(shipped, monkeypatch):
    """The preset ``smoke`` for KODex, with the few demonstrations of a random expert."""
    monkeypatch.setitem(PRESETS, "smoke", replace(PRESETS["smoke"], demos=6, methods=("kodex",)))
    monkeypatch.setattr(driver, "TRAINING", 6)
    monkeypatch.setattr("bench.plan.machine_factor", lambda: 1.0)


@pytest.fixture
def paper(shipped, monkeypatch, tmp_path):
    """The preset ``paper`` with few demonstrations and episodes; the current folder is empty."""
    preset = PRESETS["paper"]
    episodes = dict.fromkeys(preset.episodes, 12)
    short = replace(preset, episodes=episodes, demos=6, controller=ControllerConfig(epochs=5))
    monkeypatch.setitem(PRESETS, "paper", short)
    monkeypatch.setattr(driver, "TRAINING", 6)
    monkeypatch.chdir(tmp_path)
    return short


@pytest.fixture
def reference(paper, task, monkeypatch, tmp_path):
    """Ships results of KODex and two seeds of NN, run with the given changes to the preset."""

    def run_and_ship(**changes):
        study = replace(
            paper,
            tasks=(task.name,),
            methods=("kodex", "nn"),
            sizes=("small",),
            seeds=(1, 2),
            settings={("nn", "epochs"): 1},
            episodes={"success": 12},
        )
        theirs = tmp_path / "theirs"
        ran = driver.run(replace(study, **changes), theirs, Workers(1, "sequential"))
        assert ran.failed == ()
        pack([theirs], tmp_path / "small")
        monkeypatch.setattr("bench.packed.SHIPPED", tmp_path / "small")
        return Results(theirs)

    return run_and_ship


def ship(task, folder, name):
    """Ships a small random expert under the name ``first`` or ``second``; returns its weights."""
    rng = generator("random expert", task.name, *(() if name == "first" else (name,)))
    folder = folder / name
    width = experts.expert_input(Simulator(task, task.sample("probe", 1))).shape[1]
    weights = {
        "mean": rng.standard_normal(width),
        "std": 1 + rng.random(width),
        "weight0": rng.standard_normal((8, width)),
        "bias0": rng.standard_normal(8),
        "weight1": rng.standard_normal((task.layout.action_dim, 8)),
        "bias1": rng.standard_normal(task.layout.action_dim),
    }
    data = save(weights)
    folder.mkdir(parents=True)
    (folder / f"{task.name}.safetensors").write_bytes(data)
    card = {"weights_sha256": hashlib.sha256(data).hexdigest()}
    (folder / f"{task.name}.json").write_text(json.dumps(card))
    return weights


@pytest.fixture
def bench(capsys, monkeypatch):
    """Runs a command line in this process; returns its exit code, output and errors."""

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["bench", *arguments])
        with pytest.raises(SystemExit) as stop:
            main()
        out, err = capsys.readouterr()
        return int(stop.value.code or 0), out, err

    return run
