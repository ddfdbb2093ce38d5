"""Which methods can be told apart: each two of them, and letters for all of them together."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from math import isnan, nan
from typing import Any

import numpy as np
import pandas as pd

from bench.power import detectable_difference, pooled
from reports.episodes import on_common
from reports.multiple import compact_letters, holm
from reports.pairing import same_seeds, without_expert
from reports.results import Results
from reports.seed_statistics import aggregate
from tasks.data import BoolArray

PAIR = ("left", "right", "left rate", "right rate", "difference", "low", "high", "p", "p_holm")
COLUMNS = (*PAIR, "deviation", "detectable", "seeds", "n", "basis")
LEAST = 1e-9
"""Deviations [points] below are rounding errors."""


def pairs_of(results: Results, evaluations: pd.DataFrame) -> pd.DataFrame:
    """Returns one row for each two methods that share a seed, compared on common seeds and starts.

    Columns:

    - ``left`` and ``right``, and their mean rates over seeds and tasks [%];
    - ``difference`` [points] with its 95% interval ``low`` to ``high`` and ``p``, of
      `reports.seed_statistics.aggregate`;
    - ``p_holm``: p after Holm's correction for all pairs of the table;
    - ``deviation`` [points]: the standard deviation over seeds of a seed's difference, and
      ``detectable`` [points]: the smallest true difference that as many seeds find in 80% of
      studies, see `bench.power`. NaN with one seed, and where all seeds differ alike;
    - ``seeds``, ``n`` starts of each, and ``basis``, what interval and p speak of.

    Args:
        results: that hold the evaluations.
        evaluations: of one split, in which all methods have the same tasks.
    """
    tasks = evaluations.task.unique()
    rows, groups = [], results.episodes.by_seed(evaluations, ["method", "task"])
    for left, right in combinations(evaluations.method.unique(), 2):
        both = {names: group for names, group in groups.items() if names[0] in (left, right)}
        if success := on_common(both):
            sides = [[success[method, task] for task in tasks] for method in (left, right)]
            rows.append({"left": left, "right": right} | _pair(*sides))
    table = pd.DataFrame(rows, columns=[*COLUMNS])
    return table.assign(p_holm=holm(table.p.astype(float)))


def pairs_of_table(results: Results, evaluations: pd.DataFrame) -> pd.DataFrame:
    """Returns `pairs_of` the methods of a table; none if they have different seeds."""
    learnt = without_expert(evaluations)
    return pairs_of(results, learnt if same_seeds(learnt) else learnt[:0])


def _pair(left: Sequence[BoolArray], right: Sequence[BoolArray]) -> dict[str, Any]:
    """Returns the facts of a row of `pairs_of`, of success (R, N) on each task."""
    found = aggregate(list(zip(left, right, strict=True)))
    rates = [100 * np.mean([task.mean(axis=1) for task in side], axis=0) for side in (left, right)]
    deviation = float(np.std(rates[0] - rates[1], ddof=1)) if found.seeds > 1 else nan
    return {
        "left rate": rates[0].mean(),
        "right rate": rates[1].mean(),
        "difference": 100 * found.value,
        "low": 100 * found.low,
        "high": 100 * found.high,
        "p": found.p,
        "deviation": deviation,
        "detectable": _detectable(deviation, found.seeds),
        "seeds": found.seeds,
        "n": left[0].shape[1],
        "basis": found.basis,
    }


def letters_of(pairs: pd.DataFrame, rates: Mapping[str, float]) -> dict[str, str]:
    """Returns the letters of each method: those that share one cannot be told apart.

    Args:
        pairs: as `pairs_of` returns them.
        rates: of the methods. The highest has the first letter.

    Returns:
        See `reports.multiple.compact_letters`. Nothing if there is one method, or two of them have
        not been compared.
    """
    known = {(pair.left, pair.right): pair.p_holm for pair in pairs.itertuples()}
    known |= {(right, left): p for (left, right), p in known.items()}
    wanted = [(one, other) for one in rates for other in rates if one != other]
    if not wanted or not known.keys() >= set(wanted):
        return {}
    p_values = [[known.get((one, other), 1.0) for other in rates] for one in rates]
    return dict(zip(rates, compact_letters([*rates.values()], p_values), strict=True))


def smallest_shown(pairs: pd.DataFrame) -> float:
    """Returns the smallest difference [points] that the seeds could have shown of an average pair.

    That is the ``detectable`` of a pair with the deviation of all, see `bench.power.pooled`. NaN if
    seeds say nothing of how they differ.

    Args:
        pairs: as `pairs_of` returns them.
    """
    known = pairs.dropna(subset="deviation")
    if known.empty:
        return nan
    return _detectable(pooled(known.deviation), int(known.seeds.min()))


def _detectable(deviation: float, seeds: int) -> float:
    return nan if isnan(deviation) or deviation < LEAST else detectable_difference(deviation, seeds)
