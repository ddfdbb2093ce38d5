"""Statistics of success rates, by scipy."""

from scipy.stats import binomtest

CONFIDENCE = 0.95


def wilson(successes: int, n: int) -> tuple[float, float]:
    """Returns the 95% Wilson interval of a rate, as fractions."""
    interval = binomtest(successes, n).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)
