"""The smallest differences of two methods that a study can show, before it runs.

Powers are those of the paired t-test over seeds, see `bench.power`. How much a difference varies
over seeds is taken from the shipped results, see `bench.spread`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from bench.packed import SHIPPED, Packed, is_packed
from bench.power import MOST, detectable_difference, in_points, seeds_needed
from bench.presets import Study
from bench.spread import FEWEST, Spread, spread_over_seeds
from tasks.words import count_of

POINTS = (3, 5, 10)
"""Differences whose number of seeds is shown, in points of the success rate."""


@dataclass(frozen=True)
class Detectable:
    """What seeds can show if a difference varies by some standard deviation, all in points."""

    deviation: float
    """Standard deviation over seeds of the difference of two methods."""
    difference: float | None
    """The smallest difference that 80% of studies find at 5%; None with one seed."""
    seeds_needed: Mapping[int, int]
    """How many seeds it takes to find so many points in 80% of studies."""


@dataclass(frozen=True)
class StudyPower:
    """What the seeds of a study can show."""

    seeds: int
    """Number of seeds of the study."""
    overall: Detectable
    """With the deviation of all pairs of methods and tasks, see `bench.power.pooled`."""
    tasks: Mapping[str, Detectable]
    """With the deviation of all pairs of methods, by task. Tasks on which seeds do not differ
    are left out."""
    rests_on: str
    """The results from which the deviations are estimated."""
    lower_bound: tuple[str, ...]
    """Why the true deviations are larger than these, and so the differences; empty if they are
    not."""


def power_of(study: Study) -> StudyPower | None:
    """Returns what the seeds of a study can show; None if the shipped results do not tell."""
    if not is_packed(SHIPPED):
        return None
    spread = spread_over_seeds(Packed(SHIPPED).frame(), study.tasks)
    return power_given(study, spread) if spread else None


def power_given(study: Study, spread: Spread) -> StudyPower | None:
    """Returns what the seeds of a study can show; None if the seeds of the spread do not differ."""
    if not spread.overall > 0:
        return None
    seeds, reasons = len(study.seeds), []
    if spread.one_controller:
        reasons.append("all seeds there share one controller")
    if max(study.episodes.values()) < spread.episodes:
        reasons.append(f"a seed has {count_of(spread.episodes, 'episode')} there, more than here")
    return StudyPower(
        seeds,
        _detectable(spread.overall, seeds),
        {task: _detectable(one, seeds) for task, one in spread.by_task.items() if one > 0},
        _origin(spread),
        tuple(reasons),
    )


def _detectable(deviation: float, seeds: int) -> Detectable:
    difference = detectable_difference(deviation, seeds) if seeds > 1 else None
    return Detectable(
        deviation, difference, {points: seeds_needed(points, deviation) for points in POINTS}
    )


def _origin(spread: Spread) -> str:
    least, most = spread.seeds
    seeds = count_of(most, "seed") if least == most else f"{least} to {most} seeds"
    methods, tasks = ", ".join(spread.methods), ", ".join(spread.deviations)
    return f"{seeds} of the shipped results of {methods} on {tasks}"


def told(power: StudyPower | None) -> list[str]:
    """Returns in lines of plain English what a study can show."""
    if power is None:
        return [
            "the smallest difference of two methods that the seeds can show is not known: in the"
            f" shipped results of these tasks no two methods share {FEWEST} seeds, or seeds do not"
            " differ"
        ]
    return [_smallest(power), _takes(power), _rests(power)]


def _smallest(power: StudyPower) -> str:
    least = power.overall.difference
    if least is None:
        return "one seed cannot show that two methods differ"
    about = "" if least > MOST else f" {_about(power)}"
    text = (
        f"the smallest difference of two methods that {count_of(power.seeds, 'seed')} show is"
        f"{about} {in_points(least)} points (in 80% of studies, at 5%)"
    )
    low, high = _ends(power)
    if low == high:
        return text
    ends = (
        f"{in_points(points)} on {task}"
        for task in (low, high)
        if (points := power.tasks[task].difference)
    )
    return f"{text}, from {' to '.join(ends)}"


def _takes(power: StudyPower) -> str:
    low, high = _ends(power)
    parts = []
    for points, seeds in power.overall.seeds_needed.items():
        most = f" ({power.tasks[high].seeds_needed[points]} on {high})" if low != high else ""
        parts.append(f"{seeds}{most} for {points} points")
    return f"seeds to tell two methods apart: {_about(power)} {', '.join(parts)}"


def _rests(power: StudyPower) -> str:
    text = (
        f"estimated from {power.rests_on}, where the difference of two methods varies over seeds"
        f" by {power.overall.deviation:.1f} points (root mean square of the standard deviations of"
        " all pairs)"
    )
    if not power.lower_bound:
        return text
    return f"{text}: a lower bound, since {' and '.join(power.lower_bound)}"


def _about(power: StudyPower) -> str:
    return "at least" if power.lower_bound else "about"


def _ends(power: StudyPower) -> tuple[str, str]:
    """The tasks with the smallest and the largest deviation."""
    in_order = sorted(power.tasks, key=lambda task: power.tasks[task].deviation)
    return in_order[0], in_order[-1]
