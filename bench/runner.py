"""One run: it fills a queue with jobs, sends them to workers and stores each result at once.

A job starts as soon as the results that it needs are stored. Only this process makes demonstrations
and writes results.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from bench.agenda import Choice, choose
from bench.backend import IN_THIS_PROCESS, Answer, Call, Listed, Workers, answers
from bench.computing import load_weights
from bench.cores import simulator_threads
from bench.interrupts import Interrupts
from bench.isolation import Failure
from bench.job_queue import JobQueue, name_of
from bench.jobs import RunJob, jobs_of
from bench.missing import find_missing
from bench.other_controllers import check_controllers
from bench.other_kernels import check_kernels
from bench.presets import Study
from bench.progress import Progress
from bench.provenance import provenance
from bench.results_writer import ResultsWriter
from bench.spec import EXPERT, Cell, Fit
from bench.trained import trained
from bench.training_data import validation_demos
from methods.base import Method
from methods.description import stand_in
from tasks.errors import InputError


@dataclass(frozen=True)
class Outcome:
    """The outcome of a run."""

    folder: Path
    done: int
    """Results that were missing and are now stored."""
    cells: int
    """Cells of the study."""
    failed: tuple[str, ...]
    """Failures, each with its reason. Repeating the run tries them again."""


class Runner:
    """The jobs of a run. It is the `bench.backend.Supply` of its own jobs."""

    def __init__(
        self,
        writer: ResultsWriter,
        queue: JobQueue,
        where: Workers,
        workers: int,
        progress: Progress,
        interrupts: Interrupts,
        introduce: Callable[[type[Method]], None],
    ) -> None:
        """Makes a runner without jobs.

        Args:
            writer: of the results folder.
            queue: an empty queue for the jobs.
            where: where they run.
            workers: number of parallel jobs.
            progress: shows which jobs start and end.
            interrupts: says when to stop.
            introduce: makes a method of a package known to this process, without importing it.
        """
        self.results = writer.results
        self._writer, self._queue, self._where, self._workers = writer, queue, where, workers
        self._progress, self._interrupts, self._introduce = progress, interrupts, introduce
        self._choose: dict[str, Callable[[], None]] = {}
        self._cells: set[tuple[str, str]] = set()
        self._done = 0
        self._failed: dict[str, str] = {}

    # Before the jobs
    def meet(self, names: Sequence[str], calls: Sequence[Callable[[], Call]]) -> dict[str, Failure]:
        """Has workers describe methods of packages; returns failures by name."""
        failures = {}
        for index, answer in answers(Listed(calls), self._where, self._interrupts):
            if isinstance(answer.result, Failure):
                failures[names[int(index)]] = answer.result
            elif self._where.backend != IN_THIS_PROCESS:
                self._introduce(stand_in(answer.result))
        self._interrupts.check()
        return failures

    def check(self, cells: Iterable[Cell]) -> None:
        """See `bench.other_controllers` and `bench.other_kernels`."""
        check_kernels(self.results)
        check_controllers(self.results, cells)

    def load(self, cells: Iterable[Cell], weights: Mapping[str, bytes]) -> None:
        """Stores fits whose weights are given. Workers try them first.

        Args:
            cells: the cells.
            weights: the weights by their digest.

        Raises:
            InputError: a method cannot use its weights.
        """
        given = {cell.fit.key: cell.fit for cell in cells if cell.fit.weights}
        fits = [fit for fit in given.values() if not self.results.has_fit(fit)]
        calls = [partial(_loading, fit, weights[fit.weights]) for fit in fits]
        found = [
            (fits[int(index)], answer.result)
            for index, answer in answers(Listed(calls), self._where, self._interrupts)
        ]
        self._interrupts.check()
        for fit, made in found:
            if isinstance(made, Failure):
                raise InputError(f"the weights of {fit.label} cannot be used: {made.reason}")
        for fit, made in found:
            self._writer.add_fit(fit, made.parameters, made.diagnostics, made.facts)

    def copy_trained(self, cells: Iterable[Cell]) -> None:
        """Copies controllers that need no training into the results folder."""
        for spec in {spec.key: spec for cell in cells for spec in cell.controllers}.values():
            found = None if self.results.has_controller(spec) else trained(spec)
            if found:
                self._writer.add_controller(spec, found.weights, found.facts)

    def want(self, cells: Sequence[Cell], note: str = "", cached: bool = True) -> None:
        """Adds cells to the manifest, and jobs for their missing results to the queue.

        Args:
            cells: the cells.
            note: note for readers of the results.
            cached: whether newly trained controllers are kept in the cache.
        """
        self._writer.ask_for([cell.wanted for cell in cells], note)
        self._cells |= {(cell.fit.key, cell.evaluation.name) for cell in cells}
        self._add(cells, cached=cached)

    def want_choice(self, choice: Choice, study: Study, demos_keys: Mapping[str, str]) -> None:
        """Adds a choice of size and the jobs that depend on it, at first for the default size."""

        def decide() -> None:
            self._queue.discard(job for job in self._queue.waiting if name_of(choice) in job.after)
            self.want(choose(study, demos_keys, self.results, choice), study.note)

        self._choose[name_of(choice)] = decide
        self._queue.add([choice])
        self._add(choice.expected, after=choice.makes)

    def _add(self, cells: Sequence[Cell], after: Sequence[str] = (), cached: bool = True) -> None:
        missing = find_missing(self.results, [cell.wanted for cell in cells])
        self._writer.set_aside_damage()
        if not after:
            self._add_experts(cells)
        missing = missing.without(self._queue.failed)
        threads = simulator_threads(self._where.jobs)
        self._queue.add(jobs_of(cells, missing, threads, after, cached))
        self._queue.divide_long(self._workers)

    def _add_experts(self, cells: Iterable[Cell]) -> None:
        """Stores the records of experts, which learn nothing."""
        for fit in {cell.fit.key: cell.fit for cell in cells if cell.fit.method == EXPERT}.values():
            if not self.results.has_fit(fit):
                self._writer.add_fit(fit, b"", b"", provenance(0.0))

    # The jobs, as `answers` takes them
    def take(self) -> str | None:
        """Returns the name of the next job, after making the choices that come before it."""
        with self._queue.lock:
            job = self._queue.take()
            while isinstance(job, Choice):
                self._choose.pop(name_of(job))()
                self._queue.finish(name_of(job))
                job = self._queue.take()
            return name_of(job) if job else None

    def call(self, name: str) -> Call:
        """Returns the call of a job that was taken."""
        job = self._job(name)
        self._progress.start(job)
        return job.call(self.results)

    @property
    def ready(self) -> bool:
        """Whether a job or a choice can be taken."""
        return self._queue.ready

    @property
    def blocked(self) -> bool:
        """Whether jobs wait for the results of others."""
        return self._queue.blocked

    def work(self) -> None:
        """Runs the jobs until none is left.

        Raises:
            KeyboardInterrupt: Ctrl-C; results of the jobs that ended are stored.
        """
        self._progress.begin()
        for name, answer in answers(self, self._where, self._interrupts):
            self._end(name, answer)
        self._interrupts.check()

    def _end(self, name: str, answer: Answer) -> None:
        job, failed = self._job(name), isinstance(answer.result, Failure)
        if not failed:
            job.store(answer.result, self._writer)
            self._queue.finish(name)
            self._done += len(job.makes)
        elif not self._queue.divide(name):
            self.note_failure(job.label, answer.result)
            self._queue.fail(name)
        self._progress.end(job, answer.seconds, failed)

    def _job(self, name: str) -> RunJob:
        job = self._queue.running[name]
        assert isinstance(job, RunJob)
        return job

    # Outcome
    def note_failure(self, label: str, failure: Failure) -> None:
        """Stores why there is no result of that label."""
        self._writer.add_failure(label, failure.reason, failure.traceback, failure.tries)
        self._failed[label] = failure.reason

    def clear_failure(self, label: str) -> None:
        """Forgets an earlier failure."""
        self._writer.clear_failure(label)

    def outcome(self) -> Outcome:
        """Returns the outcome."""
        failed = tuple(f"{label}: {reason}" for label, reason in self._failed.items())
        return Outcome(self.results.folder, self._done, len(self._cells), failed)


def _loading(fit: Fit, weights: bytes) -> Call:
    return f"load {fit.label}", load_weights, (fit, weights, validation_demos(fit))
