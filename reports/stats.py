"""Statistics of success rates."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest, trim_mean

from tasks.data import BoolArray, IntArray, generator

CONFIDENCE = 0.95
RESAMPLES = 10_000


def rate_interval(successes: IntArray, episodes: IntArray, name: object) -> tuple[float, float]:
    """Returns the 95% interval of a success rate, as fractions: Wilson's of a single fit.

    Args:
        successes: (S,) of each seed's fit.
        episodes: (S,) of each seed's fit.
        name: of what is estimated: the resamples are drawn for it.
    """
    if len(successes) == 1:
        return wilson(int(successes[0]), int(episodes[0]))
    return bootstrap(successes, episodes, name)


def wilson(successes: int, episodes: int) -> tuple[float, float]:
    """Returns the 95% Wilson interval of a rate, as fractions."""
    interval = binomtest(successes, episodes).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)


def bootstrap(successes: IntArray, episodes: IntArray, name: object) -> tuple[float, float]:
    """Returns the 95% percentile interval of the mean rate over seeds, as fractions.

    Seeds are drawn with replacement, and of each the episodes: what another set of seeds would
    have given, on another set of starts.
    """
    rng = generator("bootstrap", str(name))
    seeds = rng.integers(len(successes), size=(RESAMPLES, len(successes)))
    counts = rng.binomial(episodes[seeds], (successes / episodes)[seeds])
    means = (counts / episodes[seeds]).mean(axis=1)
    low, high = np.quantile(means, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
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
    starts = left.shape[1]
    # Starts of the same outcomes are one: drawing how often each outcome comes up is far cheaper.
    kinds, counts = np.unique(np.concatenate([left, right]), axis=1, return_counts=True)
    weights = rng.multinomial(starts, counts / starts, size=resamples) / starts
    means = []
    for outcomes in np.split(kinds, [len(left)]):
        rates = weights @ outcomes.T.astype(np.float64)
        seeds = rng.integers(len(outcomes), size=(resamples, len(outcomes)))
        means.append(np.take_along_axis(rates, seeds, axis=1).mean(axis=1))
    differences = means[0] - means[1]
    low, high = np.quantile(differences, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    beyond = 1 + min((differences <= 0).sum(), (differences >= 0).sum())
    single = len(left) == len(right) == 1
    p = mcnemar(left[0], right[0]) if single else min(1.0, 2 * beyond / (1 + resamples))
    return Difference(float(left.mean() - right.mean()), float(low), float(high), float(p))


def mcnemar(left: BoolArray, right: BoolArray) -> float:
    """Returns the exact p-value of McNemar's test between two fits on the same starts (N,)."""
    only_left, only_right = int((left & ~right).sum()), int((right & ~left).sum())
    if only_left + only_right == 0:
        return 1.0
    return float(binomtest(only_left, only_left + only_right).pvalue)


def interquartile_mean(
    outcomes: Sequence[BoolArray], name: object, resamples: int = 2000
) -> tuple[float, float, float]:
    """Returns the interquartile mean over tasks and seeds of success, and its 95% interval.

    The bootstrap is stratified: within each task seeds are drawn again, and of each its episodes.

    Args:
        outcomes: for each task, (S, N) success of each seed's fit from each start.
        name: of what is estimated: the resamples are drawn for it.
        resamples: how many.
    """
    rng = generator("interquartile mean", str(name))
    drawn = []
    for task in outcomes:
        seeds, episodes = task.shape
        rates = task.mean(axis=1)[rng.integers(seeds, size=(resamples, seeds))]
        drawn.append(rng.binomial(episodes, rates) / episodes)
    means = trim_mean(np.concatenate(drawn, axis=1), 0.25, axis=1)
    low, high = np.quantile(means, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    value = trim_mean(np.concatenate([task.mean(axis=1) for task in outcomes]), 0.25)
    return float(value), float(low), float(high)
