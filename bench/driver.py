"""Run a study: what is missing of its cells, in jobs, each committed as it ends.

First the controllers, then the fits, then the evaluations; jobs of one kind do not depend on each
other. The driver makes the demonstrations, hands each job the arrays it needs, and is the only
one that writes results.
"""

import os
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import joblib
import pandas as pd

from bench.admission import admissions, guests, introductions
from bench.backend import IN_THIS_PROCESS, Call, Interrupts, Workers, answers, workers
from bench.clock import Clock
from bench.costs import Cost, controller_cost, evaluation_cost, fit_cost
from bench.experiments import cells_of, chosen_sizes, first_wave, recipes_of
from bench.isolation import Failure
from bench.jobs import Fitted, Piece, controller_job, evaluation_job, fit_job
from bench.machine import cached_factor
from bench.pending import pending
from bench.presets import Study
from bench.progress import Progress
from bench.run_state import StateFile
from bench.spec import EXPERT, VALIDATION, Cell, ControllerSpec, Fit, seed_blocks
from bench.store import Store, folder_name
from bench.trained import keep, trained
from methods.base import Method
from methods.description import stand_in
from methods.registry import introduced
from tasks.data import Demos, Starts
from tasks.demos import TRAINING, demos_path, load_demos, split
from tasks.errors import InputError
from tasks.experts import load_expert
from tasks.masses import NOMINAL
from tasks.recorder import record
from tasks.registry import get_task
from tasks.simulator import CHUNK

SIZES, REST = "sizes", "then"
"""What is run first where sizes are compared, and what follows, for people to read."""
LIBRARIES = ("kodex-bench", "mujoco", "numpy", "scipy", "torch")


@dataclass(frozen=True)
class Outcome:
    """What a run did."""

    folder: Path
    done: int
    """Results that were missing and are now there."""
    cells: int
    """Cells that were asked for."""
    failed: tuple[str, ...]
    """What failed, each with its reason; the same run again tries it again."""


def run(study: Study, folder: Path, where: Workers) -> Outcome:
    """Computes and stores what is missing of a study; the same call again goes on.

    Where the study compares sizes, the sizes that do best decide the cells of the rest.

    Args:
        study: what is asked for.
        folder: the results folder, made if need be.
        where: who does the jobs.

    Raises:
        InputError: the study asks for what does not exist, there is no such backend, another run
            writes to the folder, or it holds results of another controller, see `Store.check`.
        KeyboardInterrupt: Ctrl-C; what had ended is stored.
    """
    where.check()
    if study.demos < 1 or study.demos > TRAINING:
        raise InputError(f"demonstrations to train on are 1 to {TRAINING}, got {study.demos}")
    recipes = recipes_of(study)
    # The largest study there can be: what does not exist is refused before anything is made.
    largest = None if guests(study.methods) else cells_of(study, recipes)
    with _running(folder, where, str(folder)) as runner:
        study = runner.admitted(study)
        if not study.methods and not study.expert:
            return runner.outcome([])
        expected = cells_of(study, recipes) if largest is None else largest
        runner.store.check(expected)
        compared = first_wave(study, recipes)
        runner.expect(compared, expected)
        runner.compute(compared, study.note, SIZES)
        chosen = chosen_sizes(study, runner.stored(compared)) if compared else {}
        cells = cells_of(study, recipes, chosen)
        runner.compute(cells, study.note, REST if compared else "")
        return runner.outcome(cells)


def run_cells(cells: Sequence[Cell], folder: Path, where: Workers) -> Outcome:
    """Computes and stores what is missing of some cells, see `run`; trains their controllers."""
    with _running(folder, where, f"{len(cells)} evaluations again", reuse=False) as runner:
        names = guests(
            dict.fromkeys(cell.fit.method for cell in cells if cell.fit.method != EXPERT)
        )
        for name, failure in runner.meet(names, introductions(names)).items():
            raise InputError(f"method {name!r} cannot be used: {failure.reason}")
        runner.expect([], cells)
        runner.compute(cells, "", "")
        return runner.outcome(cells)


@contextmanager
def _running(folder: Path, where: Workers, title: str, reuse: bool = True) -> "Iterator[_Runner]":
    store = Store(folder)
    clock = Clock(where.jobs, time.monotonic(), cached_factor() or 1.0)
    with (
        store.locked(),
        workers(where),
        Progress(title, clock, StateFile(store), time.monotonic) as progress,
        Interrupts() as interrupts,
        introduced() as introduce,
    ):
        yield _Runner(store, where, progress, interrupts, introduce, reuse)


def count_jobs(jobs: int | None = None) -> int:
    """Returns how many processes work at a time.

    Args:
        jobs: how many; -1 for one on each core, None for BENCH_JOBS, else one on each core.

    Raises:
        InputError: it, or BENCH_JOBS, is another number below 1 or no whole number.
    """
    name, text = ("jobs", str(jobs)) if jobs is not None else ("BENCH_JOBS", "")
    text = text or os.environ.get("BENCH_JOBS") or "-1"
    if text == "-1":
        return cores()
    if not text.isdecimal() or int(text) < 1:
        raise InputError(f"{name} must be 1 or more, or -1 for one on each core, got {text!r}")
    return int(text)


def simulator_threads(jobs: int) -> int:
    """Returns the threads of an evaluation, beside so many jobs."""
    return max(1, cores() // jobs)


def cores() -> int:
    """Returns how many processor cores this process may use."""
    return int(joblib.cpu_count())


class _Runner:
    """Computes cells: controllers, then fits, then evaluations."""

    def __init__(
        self,
        store: Store,
        where: Workers,
        progress: Progress,
        interrupts: Interrupts,
        introduce: Callable[[type[Method]], None],
        reuse: bool,
    ) -> None:
        self.store, self.where, self.introduce, self.reuse = store, where, introduce, reuse
        self.progress, self.interrupts = progress, interrupts
        self.done = 0
        self.failed: dict[str, str] = {}

    def admitted(self, study: Study) -> Study:
        """Returns the study with the methods that can be used; the others have failed."""
        names = guests(study.methods)
        failures = self.meet(names, admissions(study, names))
        for name, failure in failures.items():
            self._fail(name, failure)
        for name in set(names) - set(failures):
            self.store.clear_failure(name)
        return replace(study, methods=tuple(n for n in study.methods if n not in failures))

    def meet(self, names: Sequence[str], calls: Sequence[Callable[[], Call]]) -> dict[str, Failure]:
        """Lets methods of packages be described elsewhere; returns the failures by name."""
        failures = {}
        for index, answer in answers(calls, self.where, self.interrupts):
            if isinstance(answer.result, Failure):
                failures[names[index]] = answer.result
            elif self.where.backend != IN_THIS_PROCESS:
                self.introduce(stand_in(answer.result))
        self.interrupts.check()
        return failures

    def expect(self, first: Sequence[Cell], cells: Sequence[Cell]) -> None:
        """Tells the clock what there will be to do: first some of the cells, then the others."""
        if self.reuse:
            self._take_trained(cells)
        threads = simulator_threads(self.where.jobs)
        if first:
            self.progress.expect(SIZES, pending(self.store, first).costs(threads))
        rest = pending(self.store, cells, first).costs(threads)
        self.progress.expect(REST if first else "", rest)

    def compute(self, cells: Sequence[Cell], note: str, wave: str) -> None:
        """Computes what is missing of the cells, but for what has failed in this run."""
        self.wave = wave
        if cells:
            self.store.ask_for([_possible(cell) for cell in cells], note)
            self._controllers(cells)
            self._fits(cells)
            self._evaluations(cells)

    def stored(self, cells: Sequence[Cell]) -> pd.DataFrame:
        """Returns the evaluations of the cells' fits, see `Store.frame`."""
        frame = self.store.frame()
        fits = {folder_name(cell.fit.label, cell.fit.key) for cell in cells}
        return frame[frame.folder.isin(fits)]

    def outcome(self, cells: Sequence[Cell]) -> Outcome:
        """Returns what was done for the cells."""
        failed = tuple(f"{label}: {reason}" for label, reason in self.failed.items())
        return Outcome(self.store.folder, self.done, len(cells), failed)

    def _take_trained(self, cells: Iterable[Cell]) -> None:
        """Copies the controllers that need no training into the results folder."""
        for spec in {cell.controller for cell in cells if cell.controller}:
            found = None if self.store.has_controller(spec) else trained(spec)
            if found:
                self.store.add_controller(spec, found.weights, found.facts)

    def _controllers(self, cells: Iterable[Cell]) -> None:
        wanted = {cell.controller.key: cell.controller for cell in cells if cell.controller}
        missing = [spec for spec in wanted.values() if not self.store.has_controller(spec)]
        self._dispatch(
            "controllers",
            controller_job,
            [[spec] for spec in missing],
            lambda specs: (specs[0], controller_demos(specs[0])),
            self._add_controller,
        )

    def _add_controller(self, spec: ControllerSpec, made: Fitted) -> None:
        facts = _facts(made.seconds)
        self.store.add_controller(spec, made.parameters, facts)
        if self.reuse:
            keep(spec, made.parameters, facts)

    def _fits(self, cells: Iterable[Cell]) -> None:
        wanted = {cell.fit.key: cell.fit for cell in cells}
        missing = [fit for fit in wanted.values() if not self.store.has_fit(fit)]
        for fit in missing:
            if fit.method == EXPERT:
                self.store.add_fit(fit, b"", b"", _facts(0.0))
        self._dispatch(
            "fits",
            fit_job,
            seed_blocks(fit for fit in missing if fit.method != EXPERT),
            lambda fits: (fits, training_demos(fits[0]), validation_demos(fits[0])),
            lambda fit, made: self.store.add_fit(
                fit, made.parameters, made.diagnostics, _facts(made.seconds)
            ),
        )

    def _evaluations(self, cells: Iterable[Cell]) -> None:
        missing = [piece for cell in cells if (piece := self._missing(cell))]
        threads = simulator_threads(self.where.jobs)
        self._dispatch(
            "evaluations",
            evaluation_job,
            [[piece] for piece in missing],
            lambda pieces: (pieces[0], *learnt(self.store, pieces[0].cell), threads),
            lambda piece, result: self.store.add_episodes(
                piece.cell.fit, piece.cell.evaluation, result, piece.keep
            ),
        )

    def _missing(self, cell: Cell) -> "Piece | None":
        """What is still to be evaluated of a cell; whole chunks that are there are kept.

        Nothing where the fit or the controller is not there: its failure has been noted.
        """
        starts = _starts(cell)
        stored = self.store.episodes(cell.fit, cell.evaluation)
        found = 0 if stored is None else len(stored)
        tracked = cell.controller is None or self.store.has_controller(cell.controller)
        if found >= len(starts) or not tracked or not self.store.has_fit(cell.fit):
            return None
        keep = found // CHUNK * CHUNK
        return Piece(cell, starts[keep:], keep)

    def _dispatch(
        self,
        round_: str,
        job: Callable[..., list[Any]],
        groups: Iterable[Sequence[Any]],
        arguments: Callable[[Any], tuple[Any, ...]],
        commit: Callable[[Any, Any], None],
    ) -> None:
        """Runs a job for each group of what goes together, and commits what comes of it.

        The longest job begins first, so that none is waited for at the end. A group whose job fails
        is tried again one by one.
        """
        threads = simulator_threads(self.where.jobs)
        left = [[one for one in group if one.label not in self.failed] for group in groups]
        left = sorted(filter(None, left), key=lambda group: -_cost(group, threads).seconds)
        if not left:
            return
        costs = [_cost(group, threads) for group in left]
        self.progress.begin(self.wave, round_, costs)
        calls = [
            partial(self._call, index, job, arguments, group) for index, group in enumerate(left)
        ]
        apart = []
        for index, answer in answers(calls, self.where, self.interrupts):
            group = left[index]
            failed = isinstance(answer.result, Failure)
            if not failed:
                for one, result in zip(group, answer.result, strict=True):
                    commit(one, result)
                    self.store.clear_failure(one.label)
                    self.done += 1
            elif len(group) == 1:
                self._fail(group[0].label, answer.result)
            else:
                apart += [[one] for one in group]
                self.progress.split(index)
                continue
            self.progress.end(index, answer.seconds, failed)
        self.interrupts.check()
        self._dispatch(round_, job, apart, arguments, commit)

    def _call(
        self,
        index: int,
        job: Callable[..., list[Any]],
        arguments: Callable[[Any], tuple[Any, ...]],
        group: Sequence[Any],
    ) -> Call:
        label = _label(group)
        self.progress.start(index, label)
        return label, job, arguments(group)

    def _fail(self, label: str, failure: Failure) -> None:
        self.store.add_failure(label, failure.reason, failure.traceback, failure.tries)
        self.failed[label] = failure.reason


def learnt(store: Store, cell: Cell) -> tuple[bytes, bytes]:
    """Returns what is stored of a cell's method and of its controller; nothing of an expert."""
    if cell.fit.method == EXPERT:
        return b"", b""
    controller = store.controller_weights(cell.controller) if cell.controller else b""
    return store.parameters(cell.fit), controller


def _label(group: Sequence[Any]) -> str:
    """The label of one thing, or of fits that differ in their seeds."""
    return str(group[0].label) + "".join(f",{fit.seed}" for fit in group[1:])


def _cost(group: Sequence[Any], threads: int) -> Cost:
    first = group[0]
    if isinstance(first, Fit):
        return fit_cost(group)
    if isinstance(first, ControllerSpec):
        return controller_cost(first)
    return evaluation_cost(first.cell.evaluation, len(first.starts), threads)


def training_demos(of: Fit | ControllerSpec) -> Demos:
    """Returns the training demonstrations that something learns from, made if need be."""
    return _demos(of)[0][: of.demos]


def validation_demos(of: Fit | ControllerSpec) -> Demos:
    """Returns the validation demonstrations that go with them, made if need be."""
    return _demos(of)[1]


def _demos(of: Fit | ControllerSpec) -> tuple[Demos, Demos]:
    return _demos_at(demos_path(get_task(of.task), of.recipe), of.task, of.recipe)


@cache
def _demos_at(path: Path, task: str, recipe: str) -> tuple[Demos, Demos]:
    """The demonstrations that the cache keeps there: in another cache they would lie elsewhere."""
    return split(load_demos(get_task(task), recipe))


def controller_demos(spec: ControllerSpec) -> Demos:
    """Returns what a controller learns from: demonstrations, or what the expert does elsewhere."""
    task = get_task(spec.task)
    if spec.physics != NOMINAL:
        starts = task.sample("demo", spec.demos)
    elif spec.raw:
        starts = training_demos(spec).starts
    else:
        return training_demos(spec)
    expert = load_expert(task).policy
    return record(task, starts, expert, spec.physics, failures=spec.failures, raw=spec.raw)[1]


def _possible(cell: Cell) -> Cell:
    """The cell, with no more episodes than there are starts."""
    if cell.evaluation.split != VALIDATION:
        return cell
    return replace(cell, episodes=min(cell.episodes, len(validation_demos(cell.fit))))


def _starts(cell: Cell) -> Starts:
    """The first starts of an evaluation; there are as many validation starts as demonstrations."""
    evaluation = cell.evaluation
    if evaluation.split == VALIDATION:
        return validation_demos(cell.fit).starts[: cell.episodes]
    return get_task(evaluation.task).sample(evaluation.split, cell.episodes)


def _facts(seconds: float) -> dict[str, Any]:
    """What is worth knowing about a result, and is not the same on every machine."""
    return {
        "seconds": round(seconds, 3),
        "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "host": {"platform": platform.platform(), "cores": cores()},
        "versions": {"python": platform.python_version()} | {n: version(n) for n in LIBRARIES},
    }
