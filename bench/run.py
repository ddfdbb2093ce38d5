"""Run a study: what is missing of its cells, in jobs, each committed as it ends.

First the controllers, then the fits, then the evaluations; jobs of one kind do not depend on each
other. The driver makes the demonstrations, hands each job the arrays it needs, and is the only
one that writes results.
"""

import os
import platform
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import joblib
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from bench.controller import Controller, train_controller
from bench.experiments import cells_of
from bench.presets import Study
from bench.progress import Progress
from bench.rollout import FeedbackPolicy, TrackedMotion
from bench.spec import EXPERT, VALIDATION, Cell, ControllerSpec, Evaluation, Fit
from bench.store import Store
from methods.base import ActionMethod, MotionMethod, Parameters
from tasks.data import Demos, Episodes, Starts
from tasks.demos import TRAINING, demos_key, load_demos
from tasks.errors import InputError
from tasks.experts import load_expert
from tasks.registry import get_task
from tasks.simulator import CHUNK, Policy, rollout

LIBRARIES = ("kodex-bench", "mujoco", "numpy", "scipy", "torch")


@dataclass(frozen=True)
class Outcome:
    """What a run did."""

    folder: Path
    done: int
    """Jobs that were missing and are now there."""
    cells: int
    """Cells that were asked for."""


def run(study: Study, folder: Path, jobs: int | None = None) -> Outcome:
    """Computes and stores what is missing of a study; the same call again goes on.

    Args:
        study: what is asked for.
        folder: the results folder, made if need be.
        jobs: processes at a time; BENCH_JOBS, or one for each core, unless told.

    Raises:
        InputError: the study asks for what does not exist, or another run writes to the folder.
    """
    jobs = jobs or default_jobs()
    if study.demos < 1 or study.demos > TRAINING:
        raise InputError(f"demonstrations to train on are 1 to {TRAINING}, got {study.demos}")
    recipes = {task: demos_key(get_task(task)) for task in study.tasks}
    cells = cells_of(study, recipes)
    store = Store(folder)
    with store.locked(), Progress() as progress:
        store.ask_for(cells)
        runner = _Runner(store, study.demos, jobs, progress)
        done = runner.controllers(cells) + runner.fits(cells) + runner.evaluations(cells)
    return Outcome(folder, done, len(cells))


def default_jobs() -> int:
    """Returns how many processes work at a time: BENCH_JOBS, else as many as there are cores.

    Raises:
        InputError: BENCH_JOBS is not a number from 1.
    """
    text = os.environ.get("BENCH_JOBS") or str(cores())
    if not text.isdecimal() or int(text) < 1:
        raise InputError(f"BENCH_JOBS must be a number from 1, got {text!r}")
    return int(text)


def cores() -> int:
    """Returns how many processor cores this process may use."""
    return int(joblib.cpu_count())


class _Runner:
    """The three rounds of a run."""

    def __init__(self, store: Store, demos: int, jobs: int, progress: Progress) -> None:
        self.store, self.demos, self.jobs, self.progress = store, demos, jobs, progress

    def controllers(self, cells: Iterable[Cell]) -> int:
        wanted = {cell.controller.key: cell.controller for cell in cells if cell.controller}
        missing = [spec for spec in wanted.values() if not self.store.has_controller(spec)]
        return self._dispatch(
            "controllers",
            controller_job,
            missing,
            lambda spec: (spec, _training(spec.task, spec.demos)),
            lambda spec, result: self.store.add_controller(spec, result[0], _facts(result[1])),
        )

    def fits(self, cells: Iterable[Cell]) -> int:
        wanted = {cell.fit.key: cell.fit for cell in cells}
        missing = [fit for fit in wanted.values() if not self.store.has_fit(fit)]
        for fit in missing:
            if fit.method == EXPERT:
                self.store.add_fit(fit, {}, {}, _facts(0.0))
        learning = [fit for fit in missing if fit.method != EXPERT]
        return self._dispatch(
            "fits",
            fit_job,
            learning,
            lambda fit: (fit, _training(fit.task, fit.demos), _validation(fit.task)),
            lambda fit, result: self.store.add_fit(fit, result[0], result[1], _facts(result[2])),
        )

    def evaluations(self, cells: Iterable[Cell]) -> int:
        missing = [piece for cell in cells if (piece := self._missing(cell))]
        threads = max(1, cores() // self.jobs)
        return self._dispatch(
            "evaluations",
            evaluation_job,
            missing,
            lambda piece: (piece, *self._learnt(piece.cell), threads),
            lambda piece, result: self.store.add_episodes(
                piece.cell.fit, piece.cell.evaluation, result, piece.keep
            ),
        )

    def _missing(self, cell: Cell) -> "_Piece | None":
        """What is still to be evaluated of a cell; whole chunks that are there are kept."""
        starts = _starts(cell.evaluation, cell.episodes)
        stored = self.store.episodes(cell.fit, cell.evaluation)
        found = 0 if stored is None else len(stored)
        if found >= len(starts):
            return None
        keep = found // CHUNK * CHUNK
        return _Piece(cell, starts[keep:], keep)

    def _learnt(self, cell: Cell) -> tuple[Parameters, Parameters]:
        if cell.fit.method == EXPERT:
            return {}, {}
        controller = self.store.controller_weights(cell.controller) if cell.controller else {}
        return self.store.parameters(cell.fit), controller

    def _dispatch(
        self,
        kind: str,
        job: Callable[..., Any],
        work: Sequence[Any],
        arguments: Callable[[Any], tuple[Any, ...]],
        commit: Callable[[Any, Any], None],
    ) -> int:
        """Runs a job for each piece of work, and commits what comes of it; returns how many."""
        if not work:
            return 0
        self.progress.begin(kind, len(work))
        parallel = Parallel(self.jobs, return_as="generator_unordered")
        calls = (delayed(_numbered)(i, job, arguments(piece)) for i, piece in enumerate(work))
        for index, result in parallel(calls):
            commit(work[index], result)
            self.progress.advance(work[index].label)
        return len(work)


@dataclass(frozen=True)
class _Piece:
    """The part of a cell's evaluation that is missing."""

    cell: Cell
    starts: Starts
    keep: int
    """How many stored episodes stay."""

    @property
    def label(self) -> str:
        return f"{self.cell.fit.label} {self.cell.evaluation.name} ({len(self.starts)} episodes)"


# Jobs. Each depends on its arguments alone, and runs in whichever process.
def controller_job(spec: ControllerSpec, demos: Demos) -> tuple[Parameters, float]:
    """Returns a controller's weights, and the seconds that they took."""
    began = time.perf_counter()
    weights = train_controller(spec.config, demos, spec.task)
    return weights, time.perf_counter() - began


def fit_job(fit: Fit, demos: Demos, validation: Demos) -> tuple[Parameters, Parameters, float]:
    """Returns what a method learnt, its diagnostics, and the seconds that the fit took."""
    method = fit.build()
    began = time.perf_counter()
    method.fit(demos, validation, fit.seed)
    seconds = time.perf_counter() - began
    return method.parameters(), method.diagnostics(), seconds


def evaluation_job(
    piece: _Piece, parameters: Parameters, controller: Parameters, threads: int
) -> Episodes:
    """Returns what comes of the episodes of a piece."""
    task = get_task(piece.cell.fit.task)
    policy = make_policy(piece.cell.fit, parameters, controller)
    with threadpool_limits(1):
        return rollout(task, piece.starts, policy, piece.cell.evaluation.physics, threads=threads)


def make_policy(fit: Fit, parameters: Parameters, controller: Parameters) -> Policy:
    """Returns what drives the episodes of a fit."""
    if fit.method == EXPERT:
        return load_expert(get_task(fit.task)).policy
    method = fit.build()
    method.load(parameters)
    if isinstance(method, MotionMethod):
        return TrackedMotion(method, Controller(controller))
    assert isinstance(method, ActionMethod)
    return FeedbackPolicy(method)


def _numbered(index: int, job: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[int, Any]:
    return index, job(*arguments)


@cache
def _demos(task: str) -> Demos:
    return load_demos(get_task(task))


def _training(task: str, n: int) -> Demos:
    return _demos(task)[:n]


def _validation(task: str) -> Demos:
    return _demos(task)[TRAINING:]


def _starts(evaluation: Evaluation, episodes: int) -> Starts:
    """The first starts of an evaluation; there are as many validation starts as demonstrations."""
    if evaluation.split == VALIDATION:
        return _validation(evaluation.task).starts[:episodes]
    return get_task(evaluation.task).sample(evaluation.split, episodes)


def _facts(seconds: float) -> dict[str, Any]:
    """What is worth knowing about a result, and is not the same on every machine."""
    return {
        "seconds": round(seconds, 3),
        "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "host": {"platform": platform.platform(), "cores": cores()},
        "versions": {"python": platform.python_version()} | {n: version(n) for n in LIBRARIES},
    }
