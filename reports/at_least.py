"""Whether at least so many of several differences are above a margin."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from reports.seed_statistics import Estimate
from tasks.data import FloatArray


class Corrections(NamedTuple):
    """The numbers of comparisons that the ends of an interval are corrected for."""

    low: int
    high: int


def corrections(comparisons: int, count: int) -> Corrections:
    """Returns those of the COUNT-th largest of so many true values.

    The lower end needs all but COUNT - 1 of them, the upper end COUNT (partial conjunction,
    Benjamini and Heller 2008).
    """
    return Corrections(comparisons - count + 1, count)


def kth_largest(lower: Sequence[Estimate], upper: Sequence[Estimate], count: int) -> Estimate:
    """Returns the estimate of the COUNT-th largest of the true values.

    At least so many are above the margin if, and only if, this one is. Its ends are the COUNT-th
    largest of the corrected ends, and its p-value is corrected alike. Its seeds, and what it speaks
    of, are those of the estimate with the fewest seeds.

    Args:
        lower: of the same margin, with intervals that are corrected for `corrections`' ``low``.
        upper: the same, with intervals that are corrected for ``high``.
        count: from 1 to their number.
    """
    above, below = corrections(len(lower), count)
    values, margin = np.array([one.value for one in lower]), lower[0].margin
    value = _largest(values, count)
    p = np.array([one.p for one in lower])
    up = above * np.sort(np.where(values > margin, p, 1))[count - 1]
    down = below * np.sort(np.where(values < margin, p, 1))[above - 1]
    weakest = min(lower, key=lambda one: one.seeds)
    return weakest._replace(
        value=value,
        low=_largest(np.array([one.low for one in lower]), count),
        high=_largest(np.array([one.high for one in upper]), count),
        p=min(1.0, float(down if value < margin else up)),
    )


def _largest(values: FloatArray, count: int) -> float:
    return float(np.sort(values)[-count])
