"""Whether each claim of the paper holds, in the paper's own tables and in results of this suite.

In the paper's tables, a claim holds if all its contrasts hold for the printed numbers. In results,
a claim is

- reproduced, if the whole interval of every contrast lies on the claimed side;
- contradicted, if the whole interval of some contrast lies on the other side;
- undecided otherwise;
- not run, if results are missing;
- failed, if results cannot be read.
"""

from collections.abc import Callable, Sequence
from functools import partial
from operator import attrgetter
from typing import NamedTuple

import numpy as np
import pandas as pd

from bench.labels import EXPERT
from reports.claims import BASELINES, CLAIMS, LEARNERS, OTHER_CLAIMS, Claim, Contrast, Setting
from reports.exhibits import figure_6, figure_6_time
from reports.exhibits.robustness import TABLES
from reports.exhibits.table_11 import SETS
from reports.exhibits.table_12 import magnitudes
from reports.paper import published
from reports.results import Results
from reports.stats import Difference, paired_difference
from reports.style import TASKS, display
from tasks.errors import described
from tasks.words import count_of

FAILED, NOT_RUN = "failed", "not run"


class Judgement(NamedTuple):
    """The verdict on a claim in results of this suite."""

    ours: str
    """Reproduced, contradicted, undecided, not run, or failed."""
    evidence: str
    """The contrast that decides, or comes nearest to deciding; else why there is no verdict."""


class Measured(NamedTuple):
    """A contrast and its difference in results, in points."""

    contrast: Contrast
    found: Difference

    @property
    def above_margin(self) -> float:
        """Points by which the difference exceeds the margin."""
        return self.found.value - self.contrast.margin

    def __str__(self) -> str:
        found, contrast = self.found, self.contrast
        return (
            f"{contrast.left} minus {contrast.right}: {found.value:+.1f} points"
            f" [{found.low:.1f}, {found.high:.1f}], claimed above {contrast.margin:g}"
        )


def verdicts(results: Results) -> pd.DataFrame:
    """Returns one row for each claim.

    Columns: ``claim`` its name, ``says``, ``source``, ``paper`` whether it holds in the paper's
    tables, ``ours`` and ``evidence``, see `Judgement`.
    """
    rows = []
    for claim in CLAIMS:
        judgement = _attempt(partial(judge, claim), results)
        rows.append((claim.name, claim.says, claim.source, judge_paper(claim), *judgement))
    for other in OTHER_CLAIMS:
        judgement = _attempt(JUDGES[other.name], results)
        rows.append((other.name, other.says, other.source, other.paper, *judgement))
    return pd.DataFrame(rows, columns=["claim", "says", "source", "paper", *Judgement._fields])


def _attempt(decide: Callable[[Results], Judgement], results: Results) -> Judgement:
    """Returns the judgement, or the error that prevents it."""
    try:
        return decide(results)
    except Exception as error:
        return Judgement(FAILED, described(error))


def judge(claim: Claim, results: Results) -> Judgement:
    """Returns the verdict on a claim about success."""
    measured = []
    for contrast in claim.contrasts:
        sides = (contrast.left, contrast.right)
        left, right = results.paired_success([_selection(setting) for setting in sides])
        if left is None or right is None:
            return Judgement(NOT_RUN, f"no results of {sides[0] if left is None else sides[1]}")
        found = paired_difference(left, right, str(contrast)).in_points
        measured.append(Measured(contrast, found))
    against = [one for one in measured if one.found.high <= one.contrast.margin]
    doubtful = [one for one in measured if one.found.low <= one.contrast.margin]
    verdict = "contradicted" if against else "undecided" if doubtful else "reproduced"
    shown = min(against or doubtful or measured, key=attrgetter("above_margin"))
    on_side = len(measured) - len(doubtful)
    return Judgement(
        verdict,
        f"{on_side} of {count_of(len(measured), 'comparison')} on the claimed side,"
        f" {len(against)} on the other; {shown}",
    )


def _selection(setting: Setting) -> dict[str, str]:
    """Returns the values that select a setting's evaluations."""
    names = ("method", "task", "split", "physics", "variant", "controller")
    return {name: getattr(setting, name) for name in names}


def judge_paper(claim: Claim) -> str:
    """Returns whether all contrasts hold for the numbers that the paper prints."""
    pairs = [(_printed(c.left), _printed(c.right), c) for c in claim.contrasts]
    known = [(left, right, c) for left, right, c in pairs if np.isfinite(left - right)]
    if not known:
        return "published as a figure only"
    failing = [
        f"{c.left} {left:g}, {c.right} {right:g}"
        for left, right, c in known
        if left - right <= c.margin
    ]
    compared = count_of(len(known), "comparison")
    if not failing:
        return f"holds in {len(known)} of {compared}"
    return f"fails in {len(failing)} of {compared}, as in: {failing[0]}"


def _printed(setting: Setting) -> float:
    """Returns the paper's success of a setting, NaN if its tables do not have it."""
    if setting.physics == "nominal" or setting.variant != "described":
        return np.nan
    table = published(TABLES[setting.task])
    method = setting.method
    row = method if method == EXPERT else f"{method} {setting.controller}"
    found = table[(table.row == row) & (table.column == setting.physics)].value
    return float(found.iloc[0]) if len(found) else np.nan


def judge_magnitudes(results: Results) -> Judgement:
    """Judges whether on each task some, but under half, of K's eigenvalue magnitudes exceed one."""
    found = magnitudes(results)
    if set(found) != set(TASKS):
        return Judgement(NOT_RUN, "not all tasks have a KODex")
    above = {task: float((values > 1).mean()) for task, values in found.items()}
    shares = ", ".join(f"{display(task)} {100 * share:.1f}%" for task, share in above.items())
    return _decided(all(0 < share < 0.5 for share in above.values()), f"above one: {shares}")


def judge_error(results: Results) -> Judgement:
    """Judges whether the imitation error falls from set to set of observables."""
    table = figure_6.table(results)
    return _judge_trend(table[table.row.str.endswith(figure_6.ERROR)], -1)


def judge_fit_time(results: Results) -> Judgement:
    """Judges whether the fit time grows from set to set of observables."""
    return _judge_trend(figure_6_time.table(results), 1)


def judge_training_time(results: Results) -> Judgement:
    """Judges whether each baseline trains at least three times as long as KODex on each task."""
    timed = results.main(split="test").dropna(subset="fit_seconds")
    seconds = timed.drop_duplicates(["method", "task"]).pivot(
        index="method", columns="task", values="fit_seconds"
    )
    seconds = seconds.reindex(index=LEARNERS, columns=TASKS)
    if seconds.isna().any(axis=None):
        return Judgement(NOT_RUN, "not all methods have been timed on all tasks")
    ratios = seconds.loc[list(BASELINES)] / seconds.loc["kodex"]
    ranges = [f"{display(m)} {row.min():.0f} to {row.max():.0f}" for m, row in ratios.iterrows()]
    evidence = f"times as long as KODex: {', '.join(ranges)}"
    return _decided(bool((ratios >= 3).all(axis=None)), evidence)


JUDGES: dict[str, Callable[[Results], Judgement]] = {
    "magnitudes-below-one": judge_magnitudes,
    "error-falls": judge_error,
    "time-grows": judge_fit_time,
    "trains-faster": judge_training_time,
}
"""What judges the claims that are not about success, by name of the claim."""


def _judge_trend(table: pd.DataFrame, sign: int) -> Judgement:
    """Judges whether values rise (sign 1) or fall (-1) from set to set on each task."""
    columns = dict(list(table.groupby("column", sort=False).value))
    if set(columns) != set(TASKS) or len(table) < len(TASKS) * len(SETS):
        return Judgement(NOT_RUN, "not all sets have been run on all tasks")
    failing = [display(t) for t, values in columns.items() if not _rises(values * sign)]
    evidence = f"not from set to set on: {', '.join(failing)}" if failing else "on all tasks"
    return _decided(not failing, evidence)


def _rises(values: Sequence[float]) -> bool:
    return bool((np.diff(values) > 0).all())


def _decided(holds: bool, evidence: str) -> Judgement:
    return Judgement("reproduced" if holds else "contradicted", evidence)
