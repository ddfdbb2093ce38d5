"""What the paper's own tables say of a statement, and of a claim."""

from functools import cache, singledispatch

import numpy as np
import pandas as pd

from bench.labels import EXPERT
from reports.claim import (
    AtLeast,
    Claim,
    Contrast,
    LargestAboveOne,
    Overall,
    SeedMatters,
    Setting,
    SizeMatters,
    Statement,
)
from reports.exhibits.robustness import TABLES
from reports.paper import published
from tasks.words import count_of

SIZE_TABLES = {"nn": "table_2", "lstm": "table_3", "ndp": "table_4", "ngf": "table_5"}


def judge_paper(claim: Claim) -> str:
    """Returns whether all statements of a claim hold for the numbers that the paper prints.

    The text starts with ``holds`` or ``fails`` if the paper prints numbers.
    """
    known = [(one, value) for one in claim.statements if np.isfinite(value := printed(one))]
    if not known:
        return claim.unprinted
    nearest, value = min(known, key=lambda pair: pair[1] - pair[0].margin)
    failing = sum(value <= one.margin for one, value in known)
    word, count = ("fails", failing) if failing else ("holds", len(known))
    compared = count_of(len(known), "comparison")
    return (
        f"{word} in {count} of {compared}; {nearest}: {value:{nearest.form}}{nearest.unit},"
        f" claimed above {nearest.margin:g}"
    )


@singledispatch
def printed(statement: Statement) -> float:
    """Returns the number of a statement in the paper's tables, NaN if they do not have it."""
    return np.nan


@printed.register
def _(statement: Contrast) -> float:
    return _success(statement.left) - _success(statement.right)


@printed.register
def _(statement: Overall) -> float:
    return float(np.mean([_success(left) - _success(right) for left, right in statement.pairs]))


@printed.register
def _(statement: AtLeast) -> float:
    """The number is printed if those that are missing could not change the answer."""
    values = np.array([printed(contrast) for contrast in statement.contrasts])
    ends = [
        np.sort(np.where(np.isnan(values), unknown, values))[-statement.count]
        for unknown in (-np.inf, np.inf)
    ]
    low, high = (float(end) for end in ends)
    if low > statement.margin:
        return low
    return high if high <= statement.margin else np.nan


@printed.register
def _(statement: SizeMatters) -> float:
    sizes = _table(SIZE_TABLES[statement.method]).groupby("column").value
    return float((sizes.max() - sizes.min()).mean())


@printed.register
def _(statement: SeedMatters) -> float:
    """Of the best size of each task. KODex is the same for every seed in the paper."""
    table = _table(SIZE_TABLES[statement.method])
    return float(table.loc[table.groupby("column").value.idxmax()].spread.mean())


@printed.register
def _(statement: LargestAboveOne) -> float:
    return _values("table_12")["kodex", statement.task]


def _success(setting: Setting) -> float:
    """The paper's success of a setting, NaN if its tables do not have it."""
    if setting.physics == "nominal" or setting.variant != "described":
        return np.nan
    row = EXPERT if setting.method == EXPERT else f"{setting.method} {setting.controller}"
    return _values(TABLES[setting.task])[row, setting.physics]


@cache
def _values(name: str) -> dict[tuple[str, str], float]:
    """The numbers of a table, by row and column."""
    table = _table(name)
    return dict(zip(zip(table.row, table.column, strict=True), table.value, strict=True))


@cache
def _table(name: str) -> pd.DataFrame:
    return published(name)
