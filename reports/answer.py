"""The answer of a study: which methods do best on each task, and how far others are behind."""

from collections.abc import Sequence

import pandas as pd

from reports.compare import compare
from reports.exhibits.success import success_by_method
from reports.pairing import without_expert
from reports.results import Results
from reports.style import METHODS, TASKS, display, ordered
from tasks.errors import InputError

LEVEL = 0.05
HOW = (
    "Two methods are told apart on a task if the 95% interval of their difference on the same"
    f" test starts excludes zero and q, the p-value corrected for all pairs, is below {LEVEL:g};"
    " bench compare lists all pairs. How far a method is behind is that interval, in points of"
    " success."
)
Pair = tuple[str, str]
Gaps = dict[Pair, tuple[float, float]]
"""Interval of the difference in points, by better and worse method, for pairs told apart."""


def answer(results: Results) -> list[str]:
    """Returns one sentence for each task with results on test starts.

    It names the method with the most success, those that cannot be told apart from it, and how far
    the others are behind it. The expert does not take part.
    """
    found = without_expert(results.main(split="test"))
    methods = ordered(found.method, METHODS)
    pairs, shown = _pairs(results, methods), success_by_method(results, "test")
    sentences = []
    for task in ordered(found.task, TASKS):
        here = ordered(found[found.task == task].method, METHODS)
        column = shown[shown.column == task].set_index("row").value
        rates = {method: float(column[method]) for method in here}
        gaps = _gaps(pairs[pairs.task == task])
        names = {method: results.display(method) for method in here}
        sentences.append(f"{display(task)}: {_sentence(rates, gaps, names)}.")
    return sentences


def _pairs(results: Results, methods: Sequence[str]) -> pd.DataFrame:
    """Returns the comparisons on test starts. None if no two methods have common starts."""
    try:
        table = compare(results, methods)
    except InputError:
        return pd.DataFrame(columns=["task"])
    return table[table.split == "test"]


def _gaps(pairs: pd.DataFrame) -> Gaps:
    gaps: Gaps = {}
    for pair in pairs.itertuples():
        if pair.q < LEVEL and pair.low > 0:
            gaps[pair.left, pair.right] = (pair.low, pair.high)
        elif pair.q < LEVEL and pair.high < 0:
            gaps[pair.right, pair.left] = (-pair.high, -pair.low)
    return gaps


def _sentence(rates: dict[str, float], gaps: Gaps, names: dict[str, str]) -> str:
    ranked = sorted(rates, key=lambda method: -rates[method])
    best, *others = ranked
    level = [method for method in others if (best, method) not in gaps]
    behind = [method for method in others if method not in level]
    said = _leaders([best, *level], rates, gaps, names)
    if behind:
        distances = [
            f"{names[method]}{f' is behind {names[best]}' if method == behind[0] else ''}"
            f" by {_points(*gaps[best, method])}"
            for method in behind
        ]
        said += f"; {_listed(distances)} points"
    return said


def _leaders(
    leaders: Sequence[str], rates: dict[str, float], gaps: Gaps, names: dict[str, str]
) -> str:
    best, *level = leaders
    shares = [rates[method] for method in leaders]
    share = f"{shares[0]:.1f}%"
    if not level:
        return (
            f"{names[best]} leads with {share}"
            if len(rates) > 1
            else f"{names[best]} is the only method, {share}"
        )
    if any(pair in gaps for pair in _ordered_pairs(leaders)):
        others = _listed([names[method] for method in level])
        return f"{names[best]} has the most, {share}, and cannot be told from {others}"
    if round(shares[-1], 1) != round(shares[0], 1):
        share = f"{shares[-1]:.1f} to {share}"
    return f"{_listed([names[method] for method in leaders])} cannot be told apart ({share})"


def _ordered_pairs(methods: Sequence[str]) -> list[Pair]:
    return [(one, other) for one in methods for other in methods if one != other]


def _points(low: float, high: float) -> str:
    digits = 0 if low >= 1 and round(low) != round(high) else 1
    return f"{low:.{digits}f} to {high:.{digits}f}"


def _listed(texts: Sequence[str]) -> str:
    *first, last = texts
    return f"{', '.join(first)} and {last}" if first else last
