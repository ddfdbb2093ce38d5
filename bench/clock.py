"""The clock of a run: what it has to do, how far it is, and how long it will still take.

The costs of jobs are corrected by what jobs really took: by a factor that all share, and one for
each kind of job, which counts for more the more jobs of the kind have ended.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import psutil

if TYPE_CHECKING:  # what reads a state needs no simulator
    from bench.costs import Cost

PRIOR = 0.005
"""Share of a run's expected work by which the factor before any job has ended is believed."""
LEAST = 2.0
"""Seconds of expected work by which it is believed at least: workers take time to get started."""
OVERDUE = 0.05
"""What a job that takes longer than expected still takes, as a share of its time so far."""


@dataclass
class _Running:
    label: str
    cost: Cost
    since: float


@dataclass
class _Phase:
    """Jobs that do not depend on each other; the next phase waits for the last of them."""

    wave: str
    name: str
    waiting: dict[int, Cost]
    running: dict[int, _Running] = field(default_factory=dict)
    sent: dict[int, str] = field(default_factory=dict)
    """Labels of jobs that wait for a worker; their costs are among those waiting."""
    done: int = 0
    failed: int = 0

    @property
    def costs(self) -> list[Cost]:
        """Of the jobs that have not ended."""
        return [*self.waiting.values(), *(job.cost for job in self.running.values())]

    @property
    def left(self) -> int:
        """How many results are still missing."""
        return sum(cost.count for cost in self.costs)


_Took = tuple["Cost", float]
"""What a job was expected to take, and the seconds that it took."""


class Clock:
    """What a run has done and has to do. Times are seconds of any clock, given by the caller."""

    def __init__(self, jobs: int, now: float, factor: float = 1.0) -> None:
        """Begins.

        Args:
            jobs: how many run at a time.
            now: when it begins.
            factor: of the machine, before any job has ended.
        """
        self._jobs, self._began, self._prior = jobs, now, factor
        self._phases: list[_Phase] = []
        self._current = 0
        self._ended: list[_Took] = []

    def expect(self, wave: str, phases: Mapping[str, Sequence[Cost]]) -> None:
        """Notes phases to come, in order, after those that are known.

        Args:
            wave: names a group of phases that others wait for, for people to read.
            phases: by name, the costs of the jobs.
        """
        for name, costs in phases.items():
            self._phases.append(_Phase(wave, name, dict(enumerate(costs))))

    def begin(self, wave: str, name: str, costs: Sequence[Cost]) -> None:
        """A phase begins, with the jobs that it really has; or jobs of the present one go on."""
        places = [(phase.wave, phase.name) for phase in self._phases]
        self._current = places.index((wave, name))
        for phase in self._phases[: self._current]:
            phase.waiting = {}  # there was nothing to do after all
        self._phases[self._current].waiting = dict(enumerate(costs))

    def start(self, index: int, label: str, now: float) -> None:
        """A job of the present phase is sent, or sent again; it starts once a worker is free."""
        phase = self._phases[self._current]
        again = phase.running.pop(index, None)
        if again:
            phase.waiting[index] = again.cost
        phase.sent[index] = label
        self._start_sent(now)

    def _start_sent(self, now: float) -> None:
        phase = self._phases[self._current]
        for index in list(phase.sent)[: self._jobs - len(phase.running)]:
            label, cost = phase.sent.pop(index), phase.waiting.pop(index)
            phase.running[index] = _Running(label, cost, now)

    def _pop(self, index: int) -> Cost:
        """Takes out a job that has come back, which may be one that was thought to wait."""
        phase = self._phases[self._current]
        phase.sent.pop(index, None)
        job = phase.running.pop(index, None)
        return job.cost if job else phase.waiting.pop(index)

    def end(self, index: int, seconds: float, now: float, failed: bool = False) -> None:
        """A job has ended, after so many seconds of work."""
        phase, cost = self._phases[self._current], self._pop(index)
        self._start_sent(now)
        if failed:
            phase.failed += cost.count
        else:
            phase.done += cost.count
            self._ended.append((cost, seconds))

    def split(self, index: int, now: float) -> None:
        """A job has failed whose parts will be tried one by one, when the phase goes on."""
        phase = self._phases[self._current]
        phase.waiting[-1 - index] = self._pop(index)
        self._start_sent(now)

    @property
    def phase_over(self) -> bool:
        """Whether the present phase has no job left."""
        return bool(self._phases) and not self._phases[self._current].left

    def left(self, now: float) -> float:
        """Returns the seconds until the last phase ends; each job begins once a place is free."""
        price = self._prices(now)
        total = 0.0
        for phase in self._phases[self._current :]:
            busy = [
                max(price(job.cost) - (now - job.since), OVERDUE * (now - job.since))
                for job in phase.running.values()
            ]
            waiting = [price(cost) for cost in phase.waiting.values()]
            total += schedule(waiting, self._jobs, busy)
        return total

    def _prices(self, now: float) -> _Prices:
        """What jobs have taken, and those that run take at least, once they are late."""
        left = [cost for phase in self._phases for cost in phase.costs]
        expected = sum(cost.seconds for cost in (*left, *(cost for cost, _ in self._ended)))
        weight = max(LEAST, PRIOR * expected)
        price = _Prices(self._ended, self._prior, weight)
        late = [
            (job.cost, now - job.since)
            for phase in self._phases
            for job in phase.running.values()
            if now - job.since > price(job.cost)
        ]
        return _Prices([*self._ended, *late], self._prior, weight)

    def state(self, now: float) -> dict[str, Any]:
        """Returns how far it is, as JSON's own types.

        ``gone`` and ``left`` are seconds; ``phases`` have ``wave``, ``name``, ``done``, ``of`` and
        ``failed``; ``now`` has the ``label`` of each running job, and its ``seconds`` so far.
        """
        phases = [
            {
                "wave": phase.wave,
                "name": phase.name,
                "done": phase.done,
                "of": phase.done + phase.failed + phase.left,
                "failed": phase.failed,
            }
            for phase in self._phases
        ]
        running = [
            {"label": job.label, "seconds": round(now - job.since, 1)}
            for phase in self._phases
            for job in phase.running.values()
        ]
        return {
            "gone": round(now - self._began, 1),
            "left": round(self.left(now), 1),
            "phases": [phase for phase in phases if phase["of"]],
            "now": running,
        }


class _Prices:
    """What jobs will take, by what others of their kind, and all others, have taken."""

    def __init__(self, seen: Sequence[_Took], prior: float, weight: float) -> None:
        """Takes what jobs took, and the factor of others before, believed like so many seconds."""
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


def schedule(seconds: Sequence[float], jobs: int, busy: Sequence[float] = ()) -> float:
    """Returns when the last job ends if each begins, in order, as soon as a place is free.

    Args:
        seconds: of the jobs that wait.
        jobs: how many places there are.
        busy: what the jobs that run still take; each has a place.
    """
    ends = [*busy, *[0.0] * (jobs - len(busy))]
    heapq.heapify(ends)
    for took in seconds:
        heapq.heapreplace(ends, ends[0] + took)
    return max(ends)


def since_start() -> float:
    """Returns the seconds since this process started, imports included."""
    return max(0.0, time.time() - psutil.Process().create_time())


def duration(seconds: float) -> str:
    """Returns a time in the unit that suits it."""
    for size, unit in ((3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"


def headline(state: Mapping[str, Any]) -> str:
    """Returns the times of a state in words; one that `read_state` gives may be of a dead run."""
    gone, left = state["gone"], state["left"]
    if not state.get("running", True):
        return f"stopped after {duration(gone)}; rerun the same command to resume"
    return f"{duration(gone)} gone, about {duration(left)} left ({duration(gone + left)} in all)"


def counted(state: Mapping[str, Any]) -> list[str]:
    """Returns the counts of a state, one line a wave."""
    waves: dict[str, list[str]] = {}
    for phase in state["phases"]:
        text = "{name} {done}/{of}".format(**phase)
        text += ", {failed} failed".format(**phase) if phase["failed"] else ""
        waves.setdefault(phase["wave"], []).append(text)
    return [f"{wave}: {', '.join(t)}" if wave else ", ".join(t) for wave, t in waves.items()]


def running(state: Mapping[str, Any], most: int = 3) -> str:
    """Returns what runs in a state, the first few, with the time that each has taken so far."""
    jobs = state["now"]
    shown = ["{} ({})".format(job["label"], duration(job["seconds"])) for job in jobs[:most]]
    more = [f"and {len(jobs) - most} more"] if len(jobs) > most else []
    return ", ".join(shown + more)
