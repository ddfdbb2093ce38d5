"""Runs a study: lists its cells and lets a `Runner` compute the missing results."""

import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from bench.admission import admissions, guests, introductions
from bench.agenda import make_agenda
from bench.backend import Workers, workers
from bench.clock import Clock
from bench.experiments import cells_of
from bench.guest_tasks import known_task
from bench.interrupts import Interrupts
from bench.job_queue import JobQueue
from bench.machine import cached_factor
from bench.presets import Study
from bench.progress import Progress
from bench.results_writer import writing
from bench.run_state import StateFile
from bench.runner import Outcome, Runner
from bench.spec import EXPERT, Cell
from bench.study_demos import demos_keys_of
from methods.registry import introduced
from tasks.demos import TRAINING
from tasks.errors import InputError
from tasks.pins import UNPINNED, mark, pin
from tasks.words import count_of


def run(study: Study, folder: Path, where: Workers) -> Outcome:
    """Computes and stores the missing results of a study. Repeat the call to resume.

    If the study compares sizes, the best size of each method is used in the other experiments.

    Args:
        study: the study.
        folder: the results folder, made if needed.
        where: where jobs run.

    Raises:
        InputError: the study names something that does not exist, there is no such backend,
            another run writes to the folder, or its results used controllers with other training
            settings or other kernels.
        KeyboardInterrupt: Ctrl-C; results of the jobs that ended are stored.
    """
    where.check()
    _say_pins()
    if study.demos < 1 or study.demos > TRAINING:
        raise InputError(f"a study trains on 1 to {TRAINING} demonstrations, got {study.demos}")
    for task in study.tasks:
        known_task(task)
    keys = demos_keys_of(study)
    if not guests(study.methods):
        cells_of(study, keys)  # so that bad names are refused before a folder is created
    with _running(folder, where, str(folder)) as runner:
        study = _admit(study, runner)
        if study.methods or study.expert:
            agenda = make_agenda(study, keys, runner.results)
            runner.check(agenda.cells)
            runner.load(
                agenda.cells, {one.digest: one.parameters for one in study.weights.values()}
            )
            runner.copy_trained(agenda.cells)
            runner.want(agenda.known, study.note)
            for choice in agenda.choices:
                runner.want_choice(choice, study, keys)
            runner.work()
        return runner.outcome()


def _say_pins() -> None:
    if mark() == UNPINNED:
        print(
            f"bench: results are marked {UNPINNED} and may differ in their last bits on other"
            f" machines: {pin().why_not}",
            file=sys.stderr,
        )


def run_cells(
    cells: Sequence[Cell], folder: Path, where: Workers, weights: Mapping[str, bytes]
) -> Outcome:
    """Computes and stores cells like `run`, but trains their controllers again.

    Args:
        cells: the cells.
        folder: see `run`.
        where: see `run`.
        weights: by digest, the weights of methods that are not trained.
    """
    methods = dict.fromkeys(cell.fit.method for cell in cells if cell.fit.method != EXPERT)
    with _running(folder, where, f"{count_of(len(cells), 'evaluation')} again") as runner:
        names = guests(methods)
        for name, failure in runner.meet(names, introductions(names)).items():
            raise InputError(f"method {name!r} cannot be used: {failure.reason}")
        runner.load(cells, weights)
        runner.want(cells, cached=False)
        runner.work()
        return runner.outcome()


def _admit(study: Study, runner: Runner) -> Study:
    """Returns the study without methods that cannot be used; these count as failed."""
    names = guests(study.methods)
    failures = runner.meet(names, admissions(study, names))
    for name, failure in failures.items():
        runner.note_failure(name, failure)
    for name in set(names) - set(failures):
        runner.clear_failure(name)
    return study.without(failures)


@contextmanager
def _running(folder: Path, where: Workers, title: str) -> Iterator[Runner]:
    with writing(folder) as writer, workers(where) as count:
        queue = JobQueue()
        clock = Clock(queue, count, time.monotonic(), cached_factor() or 1.0)
        with (
            Progress(title, clock, StateFile(writer), time.monotonic) as progress,
            Interrupts() as interrupts,
            introduced() as introduce,
        ):
            yield Runner(writer, queue, where, count, progress, interrupts, introduce)
