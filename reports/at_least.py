"""Whether at least so many of several differences are above a margin."""

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri, stdtrit

from reports.multiple import LEVEL
from reports.seed_statistics import OVER_SEEDS, Estimate
from tasks.data import FloatArray


def kth_largest(estimates: Sequence[Estimate], count: int) -> Estimate:
    """Returns the estimate of the COUNT-th largest of the true values.

    At least so many are above the margin if, and only if, this one is. Its ends are the COUNT-th
    largest of the ends, each moved out to the level of Bonferroni's correction: for the lower end
    for all but COUNT - 1 comparisons, for the upper end for COUNT. The p-value is corrected alike
    (partial conjunction, Benjamini and Heller 2008).

    Args:
        estimates: of the same margin and number of seeds.
        count: from 1 to their number.
    """
    above, below = len(estimates) - count + 1, count
    values = np.array([one.value for one in estimates])
    value, margin = float(_largest(values, count)), estimates[0].margin
    lows = [one.value - _wider(one, above) * (one.value - one.low) for one in estimates]
    highs = [one.value + _wider(one, below) * (one.high - one.value) for one in estimates]
    p = np.array([one.p for one in estimates])
    up = above * np.sort(np.where(values > margin, p, 1))[count - 1]
    down = below * np.sort(np.where(values < margin, p, 1))[above - 1]
    return estimates[0]._replace(
        value=value,
        low=float(_largest(np.array(lows), count)),
        high=float(_largest(np.array(highs), count)),
        p=min(1.0, float(down if value < margin else up)),
    )


def _largest(values: FloatArray, count: int) -> float:
    return float(np.sort(values)[-count])


def _wider(one: Estimate, comparisons: int) -> float:
    """The factor by which an interval widens that is corrected for so many comparisons."""
    tails = 1 - LEVEL / 2 / comparisons, 1 - LEVEL / 2
    if one.basis == OVER_SEEDS:
        corrected, plain = (stdtrit(one.seeds - 1, tail) for tail in tails)
    else:
        corrected, plain = (ndtri(tail) for tail in tails)
    return float(corrected / plain)
