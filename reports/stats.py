"""The paired bootstrap, which `reports.verdicts` alone still uses."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bench.intervals import CONFIDENCE, mcnemar
from tasks.data import BoolArray, FloatArray, generator


def _resampled(
    groups: Sequence[BoolArray], rng: np.random.Generator, resamples: int
) -> list[FloatArray]:
    """Returns the rates (R, S) of drawn seeds on drawn starts, for each group of fits (S, N).

    All groups meet the same drawn starts.
    """
    starts = groups[0].shape[1]
    # Starts with the same outcomes are equal. Drawing how often each kind occurs is far cheaper.
    kinds, counts = np.unique(np.concatenate(groups), axis=1, return_counts=True)
    weights = rng.multinomial(starts, counts / starts, size=resamples) / starts
    drawn = []
    for outcomes in np.split(kinds, np.cumsum([len(group) for group in groups])[:-1]):
        rates = weights @ outcomes.T.astype(np.float64)
        seeds = rng.integers(len(outcomes), size=(resamples, len(outcomes)))
        drawn.append(np.take_along_axis(rates, seeds, axis=1))
    return drawn


def _middle(values: FloatArray) -> tuple[float, float]:
    """Returns the ends of the middle 95%."""
    low, high = np.quantile(values, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return float(low), float(high)


class Difference(NamedTuple):
    """A difference of two success rates, as fractions: 95% interval and two-sided p-value."""

    value: float
    low: float
    high: float
    p: float

    @property
    def in_points(self) -> "Difference":
        """The same difference in points, per cent of success."""
        return Difference(100 * self.value, 100 * self.low, 100 * self.high, self.p)


def paired_difference(
    left: BoolArray, right: BoolArray, name: object, resamples: int = 2000
) -> Difference:
    """Returns left minus right of two methods on the same starts, by a hierarchical bootstrap.

    Seeds and starts are drawn with replacement. Both methods meet the same drawn starts, so that
    starts that are hard for both do not widen the interval. A single fit is drawn each time. For
    two single fits, p is that of McNemar's exact test.

    Args:
        left: (S, N) success of each seed's fit from each start.
        right: (S', N) the same for the other method.
        name: of the pair. It seeds the resampling.
        resamples: number of draws.
    """
    rng = generator("paired difference", str(name))
    means = [rates.mean(axis=1) for rates in _resampled([left, right], rng, resamples)]
    differences = means[0] - means[1]
    low, high = _middle(differences)
    beyond = 1 + min((differences <= 0).sum(), (differences >= 0).sum())
    single = len(left) == len(right) == 1
    p = mcnemar(left[0], right[0]) if single else min(1.0, 2 * beyond / (1 + resamples))
    return Difference(float(left.mean() - right.mean()), low, high, float(p))
