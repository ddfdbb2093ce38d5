"""The interval of a success rate."""

from scipy.stats import binomtest

CONFIDENCE = 0.95


def wilson(successes: int, episodes: int) -> tuple[float, float]:
    """Returns the 95% Wilson interval of a rate, as fractions."""
    interval = binomtest(successes, episodes).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)
