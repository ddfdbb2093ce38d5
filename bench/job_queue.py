"""Decides which job runs next. Jobs wait for results they need; the longest chain goes first.

The queue does not depend on what jobs do. `finishing_time` simulates the queue with the costs of
jobs: `bench plan` and the clock of a run use it to estimate the duration of a run.
"""

from __future__ import annotations

import heapq
import threading
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec, Protocol, Self, TypeVar

if TYPE_CHECKING:  # what shows the progress of a run needs no simulator
    from bench.costs import Cost

P = ParamSpec("P")
T = TypeVar("T")


class Job(Protocol):
    """Work that one process does."""

    @property
    def kind(self) -> str:
        """The kind of its results, in the plural."""

    @property
    def label(self) -> str:
        """A name for people."""

    @property
    def cost(self) -> Cost:
        """The expected cost on the reference machine."""

    @property
    def makes(self) -> Sequence[str]:
        """Keys of its results. The first one is the name of the job."""

    @property
    def needs(self) -> Sequence[str]:
        """Keys of results that it works with."""

    @property
    def after(self) -> Sequence[str]:
        """Keys of results that must have been made, or have failed, before it starts."""

    def parts(self) -> Sequence[Self]:
        """Returns smaller jobs that make the same; itself if it cannot be divided."""


def _locked(method: Callable[P, T]) -> Callable[P, T]:
    @wraps(method)
    def locked(*args: P.args, **options: P.kwargs) -> T:
        queue: Any = args[0]
        with queue.lock:
            return method(*args, **options)

    return locked


class JobQueue:
    """Jobs that wait, and jobs that run.

    For the queue, a result exists if none of its jobs makes it. Several threads may use a queue.
    """

    def __init__(self, jobs: Iterable[Job] = ()) -> None:
        self.lock = threading.RLock()
        self._waiting: dict[str, Job] = {}
        self.running: dict[str, Job] = {}
        self._makers: dict[str, str] = {}
        self._ready: list[tuple[float, str, str]] = []
        self.failed: set[str] = set()
        """Keys of results that will not be made."""
        self.add(jobs)

    @property
    def waiting(self) -> list[Job]:
        """The jobs that have not been taken."""
        return list(self._waiting.values())

    @property
    def ready(self) -> bool:
        """Whether `take` would return a job."""
        return bool(self._ready)

    @property
    def blocked(self) -> bool:
        """Whether jobs wait for the results of others."""
        return len(self._waiting) > len(self._ready)

    @_locked
    def add(self, jobs: Iterable[Job]) -> None:
        """Adds jobs, except those that make or need a failed result or make a result of others.

        Of a job that can be divided, the parts are added that do not.
        """
        for part in (part for job in jobs for part in _without(job, self.failed)):
            if self._makers.keys().isdisjoint(part.makes):
                self._waiting[name_of(part)] = part
        self._arrange()

    @_locked
    def discard(self, jobs: Iterable[Job]) -> None:
        """Removes jobs that wait."""
        for job in jobs:
            self._waiting.pop(name_of(job), None)
        self._arrange()

    @_locked
    def take(self, name: str | None = None) -> Job | None:
        """Takes out a job to run it.

        Args:
            name: of the job. Default: of those whose needs are met, the one that begins the longest
                chain of jobs; None if there is none.
        """
        if name is None:
            if not self._ready:
                return None
            name = heapq.heappop(self._ready)[-1]
        else:
            self._ready = [entry for entry in self._ready if entry[-1] != name]
            heapq.heapify(self._ready)
        job = self.running[name] = self._waiting.pop(name)
        return job

    @_locked
    def finish(self, name: str) -> None:
        """Notes that the results of a running job now exist."""
        for key in self.running.pop(name).makes:
            del self._makers[key]
            for other in self._needed_by.get(key, ()):
                self._missing[other] -= 1
                if not self._missing[other] and other in self._waiting:
                    heapq.heappush(self._ready, self._rank(other))

    @_locked
    def fail(self, name: str) -> None:
        """Removes a running job for good, and the jobs, or parts of them, that need its results."""
        lost = set(self.running.pop(name).makes)
        while lost:
            self.failed |= lost
            hit = [job for job in self.waiting if lost.intersection(job.needs)]
            lost = {key for job in hit for key in job.makes}
            for job in hit:
                del self._waiting[name_of(job)]
                for part in _without(job, self.failed):
                    self._waiting[name_of(part)] = part
                    lost -= {*part.makes}
        self._arrange()

    @_locked
    def divide(self, name: str) -> bool:
        """Replaces a running job by its parts; returns whether it has several."""
        parts = self.running[name].parts()
        if len(parts) < 2:
            return False
        del self.running[name]
        self._arrange()
        self.add(parts)
        return True

    def longest_chain(self, seconds: Callable[[Job], float]) -> float:
        """Returns the seconds of the longest chain of jobs of which each needs the one before."""
        return max(_chains(self.waiting, seconds).values(), default=0.0)

    @_locked
    def divide_long(self, workers: int) -> None:
        """Divides jobs that would still run when all other work is done, as far as they can be."""
        while True:
            chains = _chains(self.waiting, _cost)
            total = sum(map(_cost, (*self.waiting, *self.running.values())))
            long = [
                job
                for job in self.waiting
                if chains[name_of(job)] > total / workers and len(job.parts()) > 1
            ]
            if not long:
                return
            self.discard(long)
            self.add(part for job in long for part in job.parts())

    def _arrange(self) -> None:
        """Computes again what each job waits for, and its rank."""
        unfinished = [*self.running.values(), *self._waiting.values()]
        self._makers = {key: name_of(job) for job in unfinished for key in job.makes}
        self._needed_by: dict[str, list[str]] = {}
        self._missing: dict[str, int] = {}
        for name, job in self._waiting.items():
            missing = {key for key in (*job.needs, *job.after) if key in self._makers}
            self._missing[name] = len(missing)
            for key in missing:
                self._needed_by.setdefault(key, []).append(name)
        self._chains = _chains(self.waiting, _cost)
        self._ready = [self._rank(name) for name in self._waiting if not self._missing[name]]
        heapq.heapify(self._ready)

    def _rank(self, name: str) -> tuple[float, str, str]:
        return -self._chains[name], self._waiting[name].label, name


def _without(job: Job, failed: Collection[str]) -> list[Job]:
    """The parts of a job that neither make nor need a failed result; itself if it does not."""
    if not any(key in failed for key in (*job.makes, *job.needs)):
        return [job]
    parts = job.parts()
    return [kept for part in parts for kept in _without(part, failed)] if len(parts) > 1 else []


def name_of(job: Job) -> str:
    """Returns the unique name of a job."""
    return job.makes[0]


def _cost(job: Job) -> float:
    return job.cost.seconds


def _chains(jobs: Sequence[Job], seconds: Callable[[Job], float]) -> dict[str, float]:
    """Returns for each job the seconds of the longest chain that begins with it."""
    needed_by: dict[str, list[Job]] = {}
    for job in jobs:
        for key in {*job.needs, *job.after}:
            needed_by.setdefault(key, []).append(job)
    chains: dict[str, float] = {}

    def chain(job: Job) -> float:
        name = name_of(job)
        if name not in chains:
            after = {id(other): other for key in job.makes for other in needed_by.get(key, ())}
            longest = max((chain(other) for other in after.values()), default=0.0)
            chains[name] = seconds(job) + longest
        return chains[name]

    for job in jobs:
        chain(job)
    return chains


def finishing_time(
    jobs: Sequence[Job],
    workers: int,
    seconds: Callable[[Job], float],
    running: Mapping[str, float] | None = None,
) -> float:
    """Returns the seconds until the last job ends.

    Args:
        jobs: those that wait and those that run.
        workers: number of parallel jobs.
        seconds: returns the duration of a job.
        running: seconds left of the running jobs, by name.
    """
    queue = JobQueue(jobs)
    ends = [(left, name) for name, left in (running or {}).items()]
    for _, name in ends:
        queue.take(name)
    heapq.heapify(ends)
    now = 0.0
    while True:
        while len(ends) < workers and (job := queue.take()):
            heapq.heappush(ends, (now + seconds(job), name_of(job)))
        if not ends:
            return now
        now, name = heapq.heappop(ends)
        queue.finish(name)
