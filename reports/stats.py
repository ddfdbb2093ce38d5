"""Statistics of success rates."""

import numpy as np
from scipy.stats import binomtest

from tasks.data import IntArray, generator

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
