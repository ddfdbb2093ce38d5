"""Reports of any subset of methods, tasks, experiments, sizes and seeds."""

import os
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bench.experiments import cells_of
from bench.presets import experiment_names, get_preset
from bench.spec import Evaluation
from reports import write
from reports.exhibits import EXHIBITS
from reports.results import Results
from reports.write import write_report
from tasks.data import generator
from tasks.registry import TASKS, get_task

SUITE = ("expert", "kodex", "nn", "ndp")
OWN = {
    # Controller, sizes and seeds, by name.
    "mine": ("none", ("single",), (1,)),
    "closed-loop": ("none", ("x large", "1_a", "small"), (3,)),
    "own_motion": ("original", ("64",), (1, 2)),
}
"""Methods of other packages."""
OF_DIAGNOSTICS = {"table_11", "table_12", "figure_6", "figure_7", "rank"}


@cache
def everything():
    """Returns evaluations of every experiment, with methods of the suite and of packages."""
    study = replace(get_preset("paper"), methods=SUITE[1:], seeds=(1, 2))
    study = replace(study, episodes=dict.fromkeys(experiment_names(), 12))
    cells = cells_of(study, dict.fromkeys(TASKS, "key"))
    rows = [
        asdict(cell.fit) | asdict(cell.evaluation) | {"folder": f"{cell.fit.label}-{cell.fit.key}"}
        for cell in cells
    ]
    rows += [row for name in OWN for row in rows_of(name)]
    numbers = {"episodes": 12, "successes": 6, "diverged": 0}
    seconds = generator("s").random((2, len(rows)))
    return pd.DataFrame(rows).assign(**numbers, fit_seconds=seconds[0], action_seconds=seconds[1])


def rows_of(name):
    controller, sizes, seeds = OWN[name]
    for task in TASKS:
        places = [Evaluation(task, split, controller=controller) for split in ("validation", "ood")]
        places += [Evaluation(task, "test", p, controller) for p in get_task(task).physics]
        for size in sizes:
            for demos in (10, 200):
                for seed in seeds:
                    label = f"{task}-{name}-{size}-{demos}-{seed}"
                    fit = {"method": name, "variant": "described", "size": size, "config": {}}
                    fit |= {
                        "demos": demos,
                        "held_out": 0,
                        "seed": seed,
                        "demos_key": "key",
                        "pins": "p",
                        "folder": label,
                    }
                    yield from ({**fit, **asdict(place)} for place in places)


def _diagnostics(eigenvalues, values, rank, error):
    return {
        "eigenvalues": eigenvalues,
        "singular_values": values,
        "rank": rank,
        "imitation_error": error,
    }


class Subset(Results):
    """Results of some evaluations, with random episodes."""

    frame = pd.DataFrame()
    provenance = ()
    finished = ()
    experts = ("first",)

    def __init__(self, frame, diverged=False, diagnostics="sound"):
        self.frame, self.diverged, self.kind = frame, diverged, diagnostics
        self.folder, self.source = (
            Path("made up"),
            SimpleNamespace(notes=list, frame=lambda: pd.DataFrame({"expert": ["first"]})),
        )

    def outcomes(self, row):
        success = generator("subset", row["folder"]).random(row["episodes"]) < 0.5
        diverged = success | self.diverged
        return pd.DataFrame({"success": success & ~diverged, "diverged": diverged, "steps": 9})

    def readings(self, row):
        return None if row["seed"] == 2 else np.ones((row["episodes"], 99), np.float32)

    def controller_spec(self, key):
        config = {"learning_rate": 1e-4, "epochs": 300}
        return {"config": config, "demos": 10 if key < "8" else 200, "demos_key": "key"}

    def diagnostics(self, folder):
        eigenvalues = 0.7 * generator(folder).standard_normal((50, 2))
        values, rank, error = np.logspace(0, -17, 50), np.array(40), np.ones(24)
        return {
            "sound": _diagnostics(eigenvalues, values, rank, error),
            "missing": {},
            "of odd shape": _diagnostics(eigenvalues[:, 0], values[None], rank, np.ones(())),
            "empty": _diagnostics(eigenvalues[:0], values[:0], rank, np.ones((1, 1))),
            "not finite": _diagnostics(eigenvalues * np.inf, values, rank + 11, error),
        }[self.kind]


def some(values):
    """Draws a subset of the values that is not empty."""
    return st.sets(st.sampled_from(sorted(values)), min_size=1)


@st.composite
def subsets(draw):
    frame = everything()
    names = ("method", "variant", "size", "demos", "seed", "split", "physics", "controller")
    kept = frame.task.isin(draw(st.sets(st.sampled_from(TASKS), min_size=1, max_size=2)))
    for name in draw(st.lists(st.sampled_from(names), unique=True, min_size=1, max_size=3)):
        kept &= frame[name].isin(draw(some(frame[name].unique())))
    if draw(st.booleans()):
        kept &= frame.index.to_series() % 7 == draw(st.integers(0, 6))
    return frame[kept].reset_index(drop=True)


@contextmanager
def undrawn():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "_write_figure", lambda *arguments: None)
        yield


def only(**values):
    frame = everything()
    for name, value in values.items():
        frame = frame[frame[name] == value]
    return frame.reset_index(drop=True)


def check(made, folder):
    assert made.failed == {}
    page = (folder / "index.html").read_text()
    shown = {path.stem for path in made.written}
    for exhibit in EXHIBITS:
        assert (f'<section id="{exhibit.name}"' in page) == (exhibit.name in shown)
        assert (folder / f"tables/{exhibit.name}.md").exists() == (exhibit.name in shown)


@given(subsets().filter(len), st.booleans())
@example(only(method="mine"), False)
@example(only(method="mine", split="validation"), True)
@example(only(variant="set_1"), False)
@settings(max_examples=8)
def test_any_subset_of_results_has_a_report(frame, diverged):
    results = Subset(frame, diverged)
    results.check_protocol(frame, mixed=True)
    with undrawn(), TemporaryDirectory() as folder:
        check(write_report(results, Path(folder)), Path(folder))


@pytest.mark.parametrize(
    "values",
    [
        {"method": "mine"},
        {"method": "closed-loop", "task": "door"},
        {"method": "own_motion", "seed": 2},
        {"method": "expert"},
        {"variant": "published"},
        {"controller": "tuned"},
        {"task": "tool", "size": "single"},
    ],
)
def test_report_of_a_subset_draws_all_its_figures(values, tmp_path, monkeypatch):
    monkeypatch.setattr(write, "_DATED", {"svg": ("Date",)})
    made = write_report(Subset(only(**values), diverged="mine" in values.values()), tmp_path)
    check(made, tmp_path)
    names = {path.stem for path in made.written}
    drawn = {e.name for e in EXHIBITS if e.axis and e.name in names}
    assert {path.stem for path in tmp_path.glob("figures/*")} == drawn


@pytest.mark.parametrize("kind", ["missing", "of odd shape", "empty", "not finite"])
def test_unreadable_diagnostics_remove_only_their_own_exhibits(kind, tmp_path, capsys):
    with undrawn():
        sound = write_report(Subset(only(task="door", method="kodex")), tmp_path)
        made = write_report(Subset(only(task="door", method="kodex"), diagnostics=kind), tmp_path)
    lost = {path.stem for path in sound.written} - {path.stem for path in made.written}
    assert {"table_11", "table_12", "figure_7", "rank"} <= lost <= OF_DIAGNOSTICS
    assert not any((tmp_path / f"tables/{name}.md").exists() for name in lost)
    page, said = (tmp_path / "index.html").read_text(), capsys.readouterr().err
    assert len(made.failed) >= len(lost)
    for title, reason in made.failed.items():
        assert f"bench: left out: {title}: {reason}\n" in said
        assert f"Not shown, because of an error: {title}: " in page
    assert "has stored" in reason


@pytest.fixture
def two(monkeypatch):
    """The only exhibits of reports."""
    found = [e for e in EXHIBITS if e.name in ("success", "figure_5")]
    monkeypatch.setattr(write, "EXHIBITS", found)
    return found


def draw_beside(monkeypatch):
    """Has reports drawn in two processes beside this one."""
    monkeypatch.setenv("BENCH_JOBS", "2")
    monkeypatch.setattr(write, "_FIGURES_A_PROCESS", 1)


def test_figures_are_the_same_however_many_processes_draw_them(two, tmp_path, monkeypatch):
    results = Subset(only(method="mine"))
    write_report(results, tmp_path / "here")
    draw_beside(monkeypatch)
    assert write_report(results, tmp_path / "beside").failed == {}
    files = [path for path in (tmp_path / "here").rglob("*") if path.is_file()]
    assert {path.suffix for path in files} == {
        ".csv",
        ".md",
        ".tex",
        ".png",
        ".pdf",
        ".svg",
        ".html",
    }
    for path in files:
        other = tmp_path / "beside" / path.relative_to(tmp_path / "here")
        assert path.read_bytes() == other.read_bytes()


def test_figures_are_drawn_here_if_a_process_dies(two, tmp_path, monkeypatch):
    """As one does for which there is no memory."""
    success, figure_5 = two
    here = os.getpid()

    def die_elsewhere(*arguments):
        if os.getpid() != here:
            os._exit(1)
        return success.figure(*arguments)

    monkeypatch.setattr(write, "EXHIBITS", (replace(success, figure=die_elsewhere), figure_5))
    draw_beside(monkeypatch)
    made = write_report(Subset(only(method="mine")), tmp_path)
    assert made.failed == {}
    assert {path.stem for path in tmp_path.glob("figures/*.pdf")} == {"success", "figure_5"}


@pytest.mark.parametrize(
    ("part", "beside"), [("table", False), ("figure", False), ("figure", True)]
)
def test_exhibit_that_fails_removes_no_other(part, beside, two, tmp_path, monkeypatch, capsys):
    here = os.getpid()

    def fail(*arguments):
        place = "here" if os.getpid() == here else "beside"
        raise ZeroDivisionError(f"no such luck {place}")

    place = "beside" if beside else "here"
    success, figure_5 = two
    if beside:
        draw_beside(monkeypatch)
    results = Subset(only(method="mine"))
    before = write_report(results, tmp_path)
    assert (len(before.written), before.failed) == (2, {})
    monkeypatch.setattr(write, "EXHIBITS", (replace(success, **{part: fail}), figure_5))
    made = write_report(results, tmp_path)
    (reason,) = made.failed.values()
    assert list(made.failed) == ["Success on test starts"]
    assert reason.startswith(f"ZeroDivisionError: no such luck {place} (test_subsets.py:")
    assert [path.stem for path in made.written] == ["figure_5"]
    assert not list(tmp_path.rglob("success.*"))
    assert "bench: left out: Success on test starts: Zero" in capsys.readouterr().err
    page = (tmp_path / "index.html").read_text()
    assert "Success on test starts: ZeroDivisionError: no such luck" in page
    assert "<svg" in page
