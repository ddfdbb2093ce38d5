"""What a study will cost: its cells, those missing, and the time, memory and disk that they need.

Costs are measured here and now, in a short calibration, and scaled to the whole: some of the
expert's episodes of each task (a hand that rests touches nothing, and takes half the time), and for
each method and size the fit of a few demonstrations for an epoch or two. What is measured is CPU
time, which other work on the machine does not add to.
"""

import heapq
import os
import shutil
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from statistics import fmean
from time import process_time

import numpy as np

from bench.admission import guests
from bench.checking import known
from bench.controller import ControllerConfig, train_controller
from bench.experiments import cells_of, recipes_of
from bench.isolation import apart
from bench.presets import Study
from bench.spec import EXPERT, VALIDATION, Cell, ControllerSpec, Evaluation, Fit, seed_blocks
from bench.store import Store
from methods.base import Method, shortened
from methods.registry import SUITE, introduced
from tasks import demos
from tasks.data import Demos, Starts, generator
from tasks.errors import InputError, reason_of
from tasks.experts import load_expert
from tasks.registry import APPENDIX, get_task
from tasks.simulator import rollout

BYTES_PER_STEP = 4
"""Of a stored episode: one reading after each control step."""
BYTES_PER_FIT = 5_000_000
"""About the largest there is, K of 763 observables."""
GIB_PER_JOB = 1.5
"""Memory of a job with the largest fits."""
DECIDED = {"relocation": 0.4, "reorientation": 0.55}
"""Share of its steps that an episode takes until it is decided, the mean over the shipped results;
all of them in other tasks."""
_TRAINING, _VALIDATION, _EPISODES = 16, 4, 20
"""Size of the calibration."""


@dataclass(frozen=True)
class Plan:
    """What a study will cost on this machine."""

    cells: int
    missing_controllers: int
    missing_fits: int
    missing_evaluations: int
    missing_episodes: int
    cpu_hours: float
    """Of one core, by the calibration."""
    wall_hours: float
    """With as many jobs as the run will have, each taking the next cell once it is free."""
    longest_hours: float
    """What the longest jobs of the rounds take, one after the other: more jobs do not help."""
    memory_gib: float
    disk_gib: float
    free_gib: float

    def check(self) -> None:
        """Raises InputError if memory or disk will not suffice."""
        if self.disk_gib > self.free_gib:
            raise InputError(
                f"the results take about {self.disk_gib:.1f} GiB, and {self.free_gib:.1f} GiB are"
                " free: choose fewer episodes, or another folder"
            )
        if self.memory_gib > total_memory():
            raise InputError(
                f"the jobs take about {self.memory_gib:.1f} GiB of memory, and this machine has"
                f" {total_memory():.1f}: choose fewer with --jobs"
            )


def make_plan(study: Study, folder: Path, jobs: int) -> Plan:
    """Returns what a study will cost, given what its results folder already holds."""
    with introduced() as introduce:
        return _priced(_with_usable_methods(study, introduce), folder, jobs)


def _priced(study: Study, folder: Path, jobs: int) -> Plan:
    cells = cells_of(study, recipes_of(study))
    store = Store(folder)
    fits = {cell.fit.key: cell.fit for cell in cells if cell.fit.method != EXPERT}
    controllers = {cell.controller.key: cell.controller for cell in cells if cell.controller}
    learning = [fit for fit in fits.values() if not store.has_fit(fit)]
    tracking = [spec for spec in controllers.values() if not store.has_controller(spec)]
    episodes = {i: missing for i, cell in enumerate(cells) if (missing := _missing(store, cell))}
    # A round begins when the one before has ended.
    rounds = [
        [controller_seconds(spec) for spec in tracking],
        blocks_seconds(seed_blocks(learning)),
        [count * episode_seconds(cells[i].evaluation) for i, count in episodes.items()],
    ]
    size = BYTES_PER_FIT * len(learning) + BYTES_PER_STEP * sum(
        count * get_task(cells[i].fit.task).horizon for i, count in episodes.items()
    )
    return Plan(
        cells=len(cells),
        missing_controllers=len(tracking),
        missing_fits=len(learning),
        missing_evaluations=len(episodes),
        missing_episodes=sum(episodes.values()),
        cpu_hours=sum(map(sum, rounds)) / 3600,
        wall_hours=sum(schedule(seconds, jobs) for seconds in rounds) / 3600,
        longest_hours=sum(max(seconds, default=0.0) for seconds in rounds) / 3600,
        memory_gib=GIB_PER_JOB * jobs,
        disk_gib=size / 2**30,
        free_gib=free_disk(folder)[1],
    )


def _with_usable_methods(study: Study, introduce: Callable[[type[Method]], None]) -> Study:
    usable = list(study.methods)
    for name in guests(study.methods):
        try:
            introduce(known(name))
        except InputError as error:
            print(f"bench: {error}; it is left out", file=sys.stderr)
            usable.remove(name)
    return replace(study, methods=tuple(usable))


def schedule(seconds: Sequence[float], jobs: int) -> float:
    """Returns when the last job ends if each begins, in order, as soon as a place is free."""
    ends = [0.0] * jobs
    for took in seconds:
        heapq.heapreplace(ends, ends[0] + took)
    return max(ends)


def free_disk(folder: Path) -> tuple[Path, float]:
    """Returns what there is of the path to a folder, and what is free there [GiB]."""
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    return there, shutil.disk_usage(there).free / 2**30


def total_memory() -> float:
    """Returns the memory of this machine [GiB]."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30


def _missing(store: Store, cell: Cell) -> int:
    """How many episodes of a cell are not there yet."""
    wanted = cell.episodes
    if cell.evaluation.split == VALIDATION:
        wanted = min(wanted, _validation_count(cell.fit))
    stored = store.episodes(cell.fit, cell.evaluation)
    return max(0, wanted - (0 if stored is None else len(stored)))


def _validation_count(fit: Fit) -> int:
    """How many validation starts there are, without making demonstrations that are not there."""
    task = get_task(fit.task)
    if fit.recipe == demos.demos_key(task):
        return demos.VALIDATION
    return len(demos.split(demos.load_demos(task, fit.recipe))[1])


# Calibration
def episode_seconds(evaluation: Evaluation) -> float:
    """Returns the CPU seconds that an episode takes, measured on a few of the expert's."""
    decided = DECIDED.get(evaluation.task, 1.0) if evaluation.rule == APPENDIX else 1.0
    return decided * _whole_episode_seconds(evaluation.task, evaluation.rule)


@cache
def _whole_episode_seconds(task_name: str, rule: str) -> float:
    task = get_task(task_name, rule)
    starts, expert = task.sample("train", _EPISODES), load_expert(task).policy
    began = process_time()
    rollout(task, starts, expert, chunk=_EPISODES, threads=1, whole=True)
    return (process_time() - began) / _EPISODES


def blocks_seconds(blocks: Sequence[Sequence[Fit]]) -> list[float]:
    """Returns the seconds of each block of fits, see `fits_seconds`.

    Fits of a method that fails in the calibration cost the mean of the other fits; a line on stderr
    says so.
    """
    known: dict[int, float] = {}
    failed: dict[str, str] = {}
    for index, fits in enumerate(blocks):
        try:
            known[index] = fits_seconds(fits)
        except Exception as error:
            failed.setdefault(fits[0].method, reason_of(error))
    mean = fmean(seconds / len(blocks[i]) for i, seconds in known.items()) if known else 0.0
    price = "priced like the mean of the other fits" if known else "not counted"
    for method, reason in failed.items():
        print(f"bench: the calibration of {method} failed, {price}: {reason}", file=sys.stderr)
    return [known.get(i, mean * len(fits)) for i, fits in enumerate(blocks)]


def fits_seconds(fits: Sequence[Fit]) -> float:
    """Returns the CPU seconds of fits that differ in their seeds alone.

    They grow in proportion to demonstrations and epochs.
    """
    one = fits[0]
    unit = _unit_seconds(one.task, one.method, one.variant, one.size, len(fits))
    return unit * one.demos * float(one.config.get("epochs", 1))


@cache
def _unit_seconds(task_name: str, method: str, variant: str, size: str, seeds: int) -> float:
    """The seconds of fits for each demonstration and epoch."""
    if method in SUITE:
        return _measured(task_name, method, variant, size, seeds)
    return float(apart(_measured, task_name, method, variant, size, seeds))


def _measured(task_name: str, method: str, variant: str, size: str, seeds: int) -> float:
    """Fits 16 demonstrations for two epochs."""
    from methods.registry import get_method

    config = get_method(method, variant).sizes[size]
    config = replace(config, **get_method(method, variant).variants[variant])
    config = shortened(config, 2)
    epochs = getattr(config, "epochs", 1)
    training, validation = random_demos(task_name)
    layout = get_task(task_name).layout
    _warm_up()
    began = process_time()
    fitted = get_method(method, variant).fit_seeds(
        config, layout, training, validation, range(1, seeds + 1)
    )
    seconds = process_time() - began
    if len(fitted) != seeds:
        raise InputError(f"fit_seeds returned {len(fitted)} methods for {seeds} seeds")
    return seconds / (epochs * len(training))


def controller_seconds(spec: ControllerSpec) -> float:
    """Returns the seconds that a controller's training takes."""
    return _unit_controller_seconds(spec.task) * spec.demos * spec.config.epochs


@cache
def _unit_controller_seconds(task_name: str) -> float:
    training, _ = random_demos(task_name)
    _warm_up()
    began = process_time()
    train_controller(ControllerConfig(epochs=2), training, "calibration")
    return (process_time() - began) / (2 * len(training))


@cache
def _warm_up() -> None:
    """Does what only the first training of a process costs: importing torch, finding memory."""
    train_controller(ControllerConfig(epochs=1), random_demos("door")[0], "calibration")


@cache
def random_demos(task_name: str) -> tuple[Demos, Demos]:
    """Returns made-up demonstrations of a task's dimensions and length: 16 to train on, and 4."""
    task = get_task(task_name)
    rng = generator("calibration", task_name)
    count = _TRAINING + _VALIDATION
    shape = (count, task.horizon)
    # Walks rather than noise, whose velocities would tear a second-order policy apart.
    states = rng.standard_normal((*shape, task.layout.state_dim)).cumsum(axis=1) / task.horizon
    velocities = states[:, :, : task.robot_dim]
    actions = rng.uniform(-1, 1, (count, task.steps, task.layout.action_dim))
    starts = Starts(task_name, "demo", np.arange(count), np.zeros((count, 1)))
    demos = Demos(starts, states, velocities, actions)
    return demos[:_TRAINING], demos[_TRAINING:]
