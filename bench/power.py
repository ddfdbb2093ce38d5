"""What a number of seeds can show: the smallest detectable difference of two methods."""

from collections.abc import Iterable
from functools import cache
from math import sqrt
from statistics import fmean

from scipy.optimize import brentq
from scipy.stats import nct, t

from tasks.errors import InputError

POWER = 0.8
LEVEL = 0.05
MOST = 100
"""Points by which two methods can differ at most."""


def power(difference: float, deviation: float, seeds: int) -> float:
    """Returns how often the paired t-test of two methods finds a true difference at 5%, two-sided.

    Args:
        difference: of the two success rates, in the unit of the deviation.
        deviation: standard deviation over seeds of the difference of a seed, above 0.
        seeds: 2 or more.

    Raises:
        InputError: there are fewer seeds, or the deviation is not above 0.
    """
    _check(deviation, seeds)
    critical = t.isf(LEVEL / 2, seeds - 1)
    shift = abs(difference) / deviation * sqrt(seeds)
    return float(nct.sf(critical, seeds - 1, shift) + nct.sf(critical, seeds - 1, -shift))


def _check(deviation: float, seeds: int) -> None:
    if seeds < 2 or not deviation > 0:
        raise InputError(
            "power needs 2 or more seeds and a standard deviation above 0,"
            f" got {seeds} and {deviation:g}"
        )


def detectable_difference(deviation: float, seeds: int) -> float:
    """Returns the smallest true difference that so many seeds find in 80% of studies.

    Args:
        deviation: standard deviation over seeds of the difference of a seed, above 0.
        seeds: 2 or more.

    Raises:
        InputError: see `power`.
    """
    _check(deviation, seeds)
    return deviation * _in_deviations(seeds)


@cache
def _in_deviations(seeds: int) -> float:
    """Returns `detectable_difference` in standard deviations: 3.3 for three seeds, 11 for two."""
    return float(brentq(lambda size: power(size, 1, seeds) - POWER, 0, 20))


def in_points(difference: float) -> str:
    """Returns a difference in points as text, without a number if it is above `MOST`."""
    return f"more than {MOST}" if difference > MOST else f"{difference:.1f}"


def pooled(deviations: Iterable[float]) -> float:
    """Returns the root mean square of the standard deviations of several pairs of methods.

    It stands for an average pair.
    """
    return sqrt(fmean(deviation**2 for deviation in deviations))


def seeds_needed(difference: float, deviation: float) -> int:
    """Returns the fewest seeds with which a true difference is found in 80% of studies.

    Args:
        difference: of the two success rates, not 0, in the unit of the deviation.
        deviation: standard deviation over seeds of the difference of a seed, above 0.

    Raises:
        InputError: the difference is 0, or see `power`.
    """
    if difference == 0:
        raise InputError("no number of seeds finds a difference of 0")
    seeds = 2
    while power(difference, deviation, seeds) < POWER:
        seeds += 1
    return seeds
