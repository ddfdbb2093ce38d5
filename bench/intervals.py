"""The interval of a success rate, and a test of two fits from the same starts."""

from functools import cache

from scipy.stats import binomtest

from tasks.data import BoolArray

CONFIDENCE = 0.95


@cache
def wilson(successes: int, episodes: int) -> tuple[float, float]:
    """Returns the 95% Wilson interval of a rate, as fractions."""
    interval = binomtest(successes, episodes).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)


def mcnemar(left: BoolArray, right: BoolArray) -> float:
    """Returns the exact two-sided p-value of McNemar's test of success (N,) from the same starts.

    Only the starts from which one alone succeeds count.
    """
    only_left, only_right = int((left & ~right).sum()), int((right & ~left).sum())
    if only_left + only_right == 0:
        return 1.0
    return float(binomtest(only_left, only_left + only_right).pvalue)
