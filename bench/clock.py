"""The clock of a run: its progress and the estimated time left.

The durations of ended jobs correct the expected costs of the others. There is one common factor,
and one factor for each kind of job, whose weight grows with the number of ended jobs of that kind.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bench.job_queue import finishing_time, name_of

if TYPE_CHECKING:
    from bench.costs import Cost
    from bench.job_queue import Job, JobQueue

KINDS = ("controllers", "fits", "evaluations")
"""The kinds of results that a run makes."""
PRIOR = 0.005
"""Weight of the initial factor, as a share of a run's expected work."""
LEAST = 2.0
"""Least weight of the initial factor, in seconds of work: workers take time to start."""
SHOWN = 3
"""Running jobs that are named."""
OVERDUE = 0.05
"""Estimated time left of a job that is late, as a share of its time so far."""

_Took = tuple["Cost", float]
"""The expected cost of a job, and the seconds that it took."""


class Clock:
    """The progress of a run. Times are seconds of any clock, given by the caller."""

    def __init__(self, queue: JobQueue, workers: int, now: float, factor: float = 1.0) -> None:
        """Starts the clock.

        Args:
            queue: the jobs of the run.
            workers: number of parallel jobs.
            now: the time at which the run starts.
            factor: see `bench.machine.machine_factor`; used until jobs have ended.
        """
        self._queue, self._workers, self._began, self._prior = queue, workers, now, factor
        self._sent: dict[str, Job] = {}
        """Jobs that were sent and have not started: all workers are busy."""
        self._running: dict[str, tuple[Job, float]] = {}
        """The running jobs, with the times at which they started."""
        self._done, self._failed = Counter[str](), Counter[str]()
        self._ended: list[_Took] = []

    @property
    def over(self) -> bool:
        """Whether no job is left."""
        return not self._queue.waiting and not self._queue.running

    def start(self, job: Job, now: float) -> None:
        """Notes that a job is sent, or sent again. It starts as soon as a worker is free."""
        self._running.pop(name_of(job), None)
        self._sent[name_of(job)] = job
        self._start_sent(now)

    def end(self, job: Job, seconds: float, now: float, failed: bool = False) -> None:
        """Notes that a job has ended, and the seconds that it took.

        A failed job whose parts are in the queue to be tried again counts as neither done nor
        failed.
        """
        self._sent.pop(name_of(job), None)
        self._running.pop(name_of(job), None)
        self._start_sent(now)
        if not failed:
            self._done[job.kind] += job.cost.count
            self._ended.append((job.cost, seconds))
        elif self._queue.failed.issuperset(job.makes):
            self._failed[job.kind] += job.cost.count

    def _start_sent(self, now: float) -> None:
        for name in list(self._sent)[: self._workers - len(self._running)]:
            self._running[name] = self._sent.pop(name), now

    def left(self, now: float) -> float:
        """Returns the estimated seconds until the last job ends."""
        with self._queue.lock:
            jobs = [*self._queue.waiting, *self._queue.running.values()]
        price = self._prices(jobs, now)
        names = {name_of(job) for job in jobs}
        running = {
            name: max(price(job.cost) - (now - since), OVERDUE * (now - since))
            for name, (job, since) in self._running.items()
            if name in names
        }
        return finishing_time(jobs, self._workers, lambda job: price(job.cost), running)

    def _prices(self, jobs: Sequence[Job], now: float) -> _Prices:
        """Prices from the ended jobs, and from running jobs that are late."""
        expected = sum(job.cost.seconds for job in jobs) + sum(c.seconds for c, _ in self._ended)
        weight = max(LEAST, PRIOR * expected)
        price = _Prices(self._ended, self._prior, weight)
        late = [
            (job.cost, now - since)
            for job, since in self._running.values()
            if now - since > price(job.cost)
        ]
        return _Prices([*self._ended, *late], self._prior, weight)

    def state(self, now: float) -> dict[str, Any]:
        """Returns the progress of the run, as types of JSON.

        ``gone`` and ``left`` are seconds. Each of ``kinds`` has ``name``, ``done``, ``of`` and
        ``failed``. ``now`` lists the ``label`` of each running job and its ``seconds`` so far.
        """
        with self._queue.lock:
            left = Counter[str]()
            for job in (*self._queue.waiting, *self._queue.running.values()):
                left[job.kind] += job.cost.count
        kinds = [
            {
                "name": name,
                "done": self._done[name],
                "of": self._done[name] + self._failed[name] + left[name],
                "failed": self._failed[name],
            }
            for name in KINDS
        ]
        return {
            "gone": round(now - self._began, 1),
            "left": round(self.left(now), 1),
            "kinds": [kind for kind in kinds if kind["of"]],
            "now": [
                {"label": job.label, "seconds": round(now - since, 1)}
                for job, since in self._running.values()
            ],
        }


class _Prices:
    """Estimates the seconds of jobs from ended jobs of the same kind and of all kinds."""

    def __init__(self, seen: Sequence[_Took], prior: float, weight: float) -> None:
        """Takes ended jobs with their seconds, and an initial factor with its weight in seconds."""
        known = [(cost.seconds, took) for cost, took in seen if cost.known]
        expected, took = map(sum, zip((weight, weight * prior), *known, strict=True))
        self._common = took / expected
        kinds: dict[str, list[_Took]] = {}
        for cost, seconds in seen:
            kinds.setdefault(cost.kind, []).append((cost, seconds))
        self._factors = {kind: self._factor(jobs) for kind, jobs in kinds.items()}

    def _factor(self, jobs: Sequence[_Took]) -> float:
        expected, took = sum(cost.seconds for cost, _ in jobs), sum(took for _, took in jobs)
        if not jobs[0][0].known:
            return took / expected
        own = (took + LEAST * self._common) / (expected + LEAST)
        share = len(jobs) / (len(jobs) + 1)
        return share * own + (1 - share) * self._common

    def __call__(self, cost: Cost) -> float:
        return cost.seconds * self._factors.get(cost.kind, self._common)


def duration(seconds: float) -> str:
    """Returns a duration as text, in hours, minutes or seconds."""
    for size, unit in ((3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"


def headline(state: Mapping[str, Any]) -> str:
    """Returns the times of a state in words; the state may be of a stopped run."""
    gone, left = state["gone"], state["left"]
    if not state.get("running", True):
        return f"stopped after {duration(gone)}; rerun the same command to resume"
    return f"{duration(gone)} gone, about {duration(left)} left ({duration(gone + left)} in all)"


def counted(state: Mapping[str, Any]) -> str:
    """Returns the counts of a state: ``fits 3/20, evaluations 0/48``."""
    return ", ".join(
        "{name} {done}/{of}".format(**kind)
        + (f" ({kind['failed']} failed)" if kind["failed"] else "")
        for kind in state["kinds"]
    )


def running(state: Mapping[str, Any]) -> str:
    """Returns the first few running jobs of a state, each with its time so far."""
    jobs = state["now"]
    shown = ["{} ({})".format(job["label"], duration(job["seconds"])) for job in jobs[:SHOWN]]
    more = [f"and {len(jobs) - SHOWN} more"] if len(jobs) > SHOWN else []
    return ", ".join(shown + more)
