"""Statistics of success rates."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest, trim_mean

from bench.intervals import CONFIDENCE, wilson
from tasks.data import BoolArray, FloatArray, generator

RESAMPLES = 10_000


def rate_interval(outcomes: BoolArray, name: object) -> tuple[float, float]:
    """Returns the 95% interval of a success rate, as fractions: Wilson's of a single fit.

    Args:
        outcomes: (S, N) success of each seed's fit from each start.
        name: of what is estimated: the resamples are drawn for it.
    """
    if len(outcomes) == 1:
        return wilson(int(outcomes.sum()), outcomes.size)
    return bootstrap(outcomes, name)


def bootstrap(outcomes: BoolArray, name: object) -> tuple[float, float]:
    """Returns the 95% percentile interval of the mean rate over seeds, as fractions.

    Seeds and starts are drawn with replacement: what another set of seeds would have given, on
    another set of starts. All seeds meet the same starts, those that are drawn too: a start that is
    hard is hard for most of them.

    Args:
        outcomes: (S, N) success of each seed's fit from each start.
        name: of what is estimated: the resamples are drawn for it.
    """
    (rates,) = _redrawn([outcomes], generator("bootstrap", str(name)), RESAMPLES)
    return _middle(rates.mean(axis=1))


def _redrawn(
    groups: Sequence[BoolArray], rng: np.random.Generator, resamples: int
) -> list[FloatArray]:
    """Rates (R, S) of drawn seeds on drawn starts, of fits (S, N) that all meet the same starts."""
    starts = groups[0].shape[1]
    # Starts of the same outcomes are one: drawing how often each outcome comes up is far cheaper.
    kinds, counts = np.unique(np.concatenate(groups), axis=1, return_counts=True)
    weights = rng.multinomial(starts, counts / starts, size=resamples) / starts
    drawn = []
    for outcomes in np.split(kinds, np.cumsum([len(group) for group in groups])[:-1]):
        rates = weights @ outcomes.T.astype(np.float64)
        seeds = rng.integers(len(outcomes), size=(resamples, len(outcomes)))
        drawn.append(np.take_along_axis(rates, seeds, axis=1))
    return drawn


def _middle(values: FloatArray) -> tuple[float, float]:
    """The ends of the middle 95%."""
    low, high = np.quantile(values, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return float(low), float(high)


class Difference(NamedTuple):
    """Of two success rates, as fractions, with its 95% interval and two-sided p-value."""

    value: float
    low: float
    high: float
    p: float


def paired_difference(
    left: BoolArray, right: BoolArray, name: object, resamples: int = 2000
) -> Difference:
    """Returns left minus right of two methods on the same starts, by a hierarchical bootstrap.

    Both seeds and starts are drawn with replacement; the starts are the same for both methods, so
    that what makes a start hard for both does not blur the difference. One fit, as of a method
    without seeds, is drawn again and again. Of two single fits, p is that of McNemar's exact test.

    Args:
        left: (S, N) success of each seed's fit from each start.
        right: (S', N) likewise of the other method.
        name: of what is compared: the resamples are drawn for it.
        resamples: how many.
    """
    rng = generator("paired difference", str(name))
    means = [rates.mean(axis=1) for rates in _redrawn([left, right], rng, resamples)]
    differences = means[0] - means[1]
    low, high = _middle(differences)
    beyond = 1 + min((differences <= 0).sum(), (differences >= 0).sum())
    single = len(left) == len(right) == 1
    p = mcnemar(left[0], right[0]) if single else min(1.0, 2 * beyond / (1 + resamples))
    return Difference(float(left.mean() - right.mean()), low, high, float(p))


def mcnemar(left: BoolArray, right: BoolArray) -> float:
    """Returns the exact p-value of McNemar's test between two fits on the same starts (N,)."""
    only_left, only_right = int((left & ~right).sum()), int((right & ~left).sum())
    if only_left + only_right == 0:
        return 1.0
    return float(binomtest(only_left, only_left + only_right).pvalue)


def mean_over_tasks(
    outcomes: Sequence[BoolArray], trimmed: float, name: object, resamples: int = 2000
) -> tuple[float, float, float]:
    """Returns the mean over tasks and seeds of success, and its 95% interval.

    The bootstrap is stratified: within each task seeds and starts are drawn again.

    Args:
        outcomes: for each task, (S, N) success of each seed's fit from each start.
        trimmed: share of the rates that is left out at either end; 0.25 is the interquartile mean.
        name: of what is estimated: the resamples are drawn for it.
        resamples: how many.
    """
    rng = generator("mean over tasks", str(name))
    drawn = [rates for task in outcomes for rates in _redrawn([task], rng, resamples)]
    low, high = _middle(trim_mean(np.concatenate(drawn, axis=1), trimmed, axis=1))
    value = trim_mean(np.concatenate([task.mean(axis=1) for task in outcomes]), trimmed)
    return float(value), low, high
