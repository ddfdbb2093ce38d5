"""The answer of a study: which methods do best on each task, and how far others are behind."""

from collections.abc import Sequence

import pandas as pd

from methods.registry import TO_BEAT
from reports.multiple import LEVEL
from reports.pairing import keep_common, same_seeds, without_expert
from reports.pairs import pairs_of
from reports.results import Results
from reports.seed_statistics import ONE_SEED
from reports.style import METHODS, display, ordered
from tasks.registry import TASKS

HOW = (
    "Two methods are told apart on a task if p, paired by seed and start and corrected for all"
    f" pairs of methods of the task (Holm), is at most {LEVEL:g}; bench compare lists all pairs."
    " How far a method is behind is the 95% interval of the difference, in points of success."
)
FIXED = "The expert of a task is fixed: what another expert would give is outside every interval."
Pair = tuple[str, str]
Gaps = dict[Pair, tuple[float, float]]
"""Interval of the difference in points, by better and worse method, for pairs told apart."""


def answer(results: Results, success: pd.DataFrame) -> list[str]:
    """Returns one sentence for each task with results on test starts.

    It names the method with the most success, those that cannot be told apart from it, and how far
    the others are behind it. The expert does not take part.

    Args:
        results: of a run.
        success: the table of `reports.exhibits.success`.
    """
    found = without_expert(keep_common(results.rows.main(split="test")))
    sentences = []
    for task in ordered(found.task, TASKS):
        here = found[found.task == task]
        if not same_seeds(here):
            sentences.append(f"{display(task)}: methods have different seeds, so none is ahead.")
            continue
        column = success[success.column == task].set_index("row").value
        rates = {method: float(column[method]) for method in ordered(here.method, METHODS)}
        pairs = pairs_of(results, here)
        names = {method: results.display(method) for method in rates}
        single = f" ({ONE_SEED})" if here.seed.nunique() == 1 else ""
        said = _sentence(rates, _gaps(pairs), names)
        sentences.append(f"{display(task)}: {said}{single}.")
    return sentences


def to_beat(results: Results, success: pd.DataFrame, beyond: pd.DataFrame) -> list[str]:
    """Returns a sentence on the line to beat, and one on closed-loop methods.

    Each is left out if the results have no such methods.

    Args:
        results: of a run.
        success: the table of `reports.exhibits.success`.
        beyond: the table of all methods of `reports.exhibits.beyond`.
    """
    simple = _rates(results, success[success.row.isin(TO_BEAT)])
    closed = _rates(results, beyond[beyond.row.isin(results.rows.beyond)])
    kinds = {
        "The line to beat": simple,
        "Closed-loop methods, which see states on the way": closed,
    }
    return [f"{kind}: {'; '.join(rates)}." for kind, rates in kinds.items() if rates]


def _rates(results: Results, table: pd.DataFrame) -> list[str]:
    return [
        f"{results.display(method)} {_by_task(part)}"
        for method, part in table.groupby("row", sort=False)
    ]


def _by_task(rates: pd.DataFrame) -> str:
    return _listed([f"{one.value:.1f}% ({display(one.column)})" for one in rates.itertuples()])


def _gaps(pairs: pd.DataFrame) -> Gaps:
    gaps: Gaps = {}
    for pair in pairs[pairs.p_holm <= LEVEL].itertuples():
        if pair.difference > 0:
            gaps[pair.left, pair.right] = (pair.low, pair.high)
        else:
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
