"""Intervals and tests where a seed repeats the whole study.

Arrays have the axes K (conditions), R (seeds) and N (starts of a seed). A seed draws its own
demonstrations, controller, random numbers and starts, and all methods of a seed share them: seeds
are independent, and two methods are compared within each seed. All intervals are 95%, as fractions.

An interval is the wider of two: over seeds, by Student's t with R - 1 degrees of freedom; and over
starts, as if all seeds were alike, which bounds it where few seeds agree by chance. How often they
cover the truth stands in docs/statistics.md.
"""

from collections.abc import Sequence
from math import hypot, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import expit, logit, ndtr, ndtri, stdtr, stdtrit
from scipy.stats import page_trend_test, spearmanr

from bench.intervals import CONFIDENCE, mcnemar, wilson
from tasks.data import FloatArray, IntArray, real
from tasks.errors import InputError

OVER_SEEDS = "over seeds"
ALIKE = "over episodes: every seed is at the same extreme"
ONE_SEED = "this fit and this controller only"
_TAIL = (1 - CONFIDENCE) / 2
_ROUNDING = 1e-12
"""Differences of rates that are rounding errors."""


class Rate(NamedTuple):
    """A success rate with its 95% interval, as fractions."""

    value: float
    low: float
    high: float
    seeds: int
    basis: str
    """What the interval speaks of: OVER_SEEDS, ALIKE or ONE_SEED."""


class Estimate(NamedTuple):
    """A difference or a correlation with its 95% interval and its test against a margin."""

    value: float
    low: float
    high: float
    p: float
    """Two-sided, of the hypothesis that the true value equals the margin."""
    margin: float
    seeds: int
    basis: str
    """What interval and p-value speak of: OVER_SEEDS, ALIKE or ONE_SEED."""


def rate(outcomes: ArrayLike) -> Rate:
    """Returns a method's success rate: the mean over seeds of each seed's rate.

    Over seeds the interval is Student's t on the logit scale by the delta method, so that it stays
    within 0 and 1; over starts it is Wilson's of all episodes, which alone remains with one seed,
    or where every seed is at the same extreme.

    Args:
        outcomes: (R, N) success of each episode.

    Raises:
        InputError: outcomes are not (R, N) numbers from 0 to 1, or there are none.
    """
    episodes = _checked(outcomes)
    rates = episodes.mean(axis=1)
    low, high = wilson(round(episodes.sum()), episodes.size)
    value, basis = float(rates.mean()), _basis(episodes)
    if basis != OVER_SEEDS:
        return Rate(value, low, high, len(rates), basis)
    ends = _Seeds(rates).ends(critical(len(rates)))
    return Rate(value, min(low, ends[0]), max(high, ends[1]), len(rates), OVER_SEEDS)


def difference(
    left: ArrayLike, right: ArrayLike, margin: float = 0.0, comparisons: int = 1
) -> Estimate:
    """Returns left minus right of two methods that share seeds and starts.

    Over seeds the interval is the wider of the paired t and of its form on the logit scale, which
    reaches further where a rate near 0 or 1 varies (the square-and-add of Newcombe 1998, scaled by
    the paired over the unpaired standard error). Over starts it is that of Agresti and Min (2005),
    which alone remains with one seed, or where every seed is at the same extreme. p is 1 less the
    confidence at which the interval ends at the margin; with one seed and no margin, that of
    McNemar's exact test.

    Args:
        left: (R, N) success of each episode; from `aggregate`, a mean over conditions.
        right: (R, N) success of the other method from the same starts of the same seeds.
        margin: the difference that p tests for, as a fraction.
        comparisons: the number that the interval is corrected for (Bonferroni). p is not.

    Raises:
        InputError: the arrays are not of one shape (R, N) with numbers from 0 to 1, or are empty.
    """
    one, other = _checked(left), _checked(right)
    if one.shape != other.shape:
        raise InputError(
            f"a difference needs the same seeds and starts of both methods (R, N),"
            f" got shapes {one.shape} and {other.shape}"
        )
    gaps = one - other
    value, basis = float(gaps.mean()), _basis(np.stack([one, other], axis=2))
    low, high, p = _over_starts(gaps, margin, _TAIL / comparisons)
    if basis == ONE_SEED and margin == 0 and np.isin(gaps, (-1, 0, 1)).all():
        p = mcnemar(one[0] > 0.5, other[0] > 0.5)
    if basis == OVER_SEEDS:
        seeds = PairedSeeds(one.mean(axis=1), other.mean(axis=1))
        ends = seeds.ends(critical(len(one), comparisons))
        low, high, p = min(low, ends[0]), max(high, ends[1]), max(p, seeds.p(margin))
    return Estimate(value, low, high, p, margin, len(one), basis)


def aggregate(pairs: Sequence[tuple[ArrayLike, ArrayLike]], margin: float = 0.0) -> Estimate:
    """Returns the mean over conditions of left minus right, which is one value a seed.

    Args:
        pairs: for each of K conditions, left and right as in `difference`, of one shape (R, N).
        margin: the mean difference that p tests for, as a fraction.

    Raises:
        InputError: there is no condition, the conditions differ in shape, or see `difference`.
    """
    shapes = {np.shape(side) for pair in pairs for side in pair}
    if len(shapes) != 1:
        raise InputError(
            "an aggregate needs conditions of the same seeds and number of starts (R, N),"
            f" got shapes {', '.join(map(str, sorted(shapes))) or 'of no condition'}"
        )
    left, right = (np.mean([_checked(pair[side]) for pair in pairs], axis=0) for side in (0, 1))
    return difference(left, right, margin)


def mean_of(values: ArrayLike, margin: float = 0.0) -> Estimate:
    """Returns the mean of one number for each seed, with Student's t over seeds.

    Args:
        values: (R,) of two seeds or more.
        margin: the mean that p tests for.

    Raises:
        InputError: there are fewer than two values, or one is not finite.
    """
    found = real("values", values)
    if found.ndim != 1 or len(found) < 2 or not np.isfinite(found).all():
        raise InputError(f"a mean over seeds needs two or more finite values, got {found.tolist()}")
    seeds, value = len(found), float(found.mean())
    error = float(found.std(ddof=1)) / sqrt(seeds)
    half = critical(seeds) * error
    p = 2 * stdtr(seeds - 1, -abs(value - margin) / error) if error else float(value == margin)
    return Estimate(value, value - half, value + half, float(p), margin, seeds, OVER_SEEDS)


def rank_correlation(levels: ArrayLike, values: ArrayLike) -> Estimate:
    """Returns how far values tend to rise with levels: the mean of Spearman's rank correlation.

    The interval is Student's t over seeds, cut at -1 and 1, and never narrower than that of as many
    orders drawn at random, which alone remains with one seed. p is that of Page's trend test
    (1963), two-sided, whose blocks are all seeds and panels; 1 with one block.

    Args:
        levels: (L,) what values may rise with, such as the number of observables; L is 3 or more.
        values: (R, K, L) of each seed, panel (such as a task) and level.

    Raises:
        InputError: the shapes differ from these, there are fewer than 3 levels, two are equal, or
            a value is not finite.
    """
    steps, table = real("levels", levels), real("values", values)
    if (
        table.ndim != 3
        or steps.shape != table.shape[2:]
        or len(np.unique(steps)) < max(3, len(steps))
        or not np.isfinite(table).all()
    ):
        raise InputError(
            "a rank correlation needs 3 or more different levels (L,) and finite values (R, K, L),"
            f" got levels {steps.tolist()} and values of shape {table.shape}"
        )
    ordered = table[..., np.argsort(steps)]
    rising = np.arange(len(steps))
    by_seed = np.array([np.mean([_spearman(rising, panel) for panel in seed]) for seed in ordered])
    value, seeds, blocks = float(by_seed.mean()), len(by_seed), ordered.reshape(-1, len(steps))
    # Of L values in random order, Spearman's correlation has the variance 1 / (L - 1).
    half = float(ndtri(1 - _TAIL)) / sqrt(len(blocks) * (len(steps) - 1))
    if seeds > 1:
        half = max(half, critical(seeds) * float(by_seed.std(ddof=1)) / sqrt(seeds))
    low, high = max(-1.0, value - half), min(1.0, value + half)
    basis = OVER_SEEDS if seeds > 1 else ONE_SEED
    return Estimate(value, low, high, _trend_p(blocks), 0.0, seeds, basis)


def _trend_p(blocks: FloatArray) -> float:
    """The two-sided p-value of Page's test, whose blocks (B, L) may rise or fall."""
    if len(blocks) == 1:
        return 1.0
    return min(1.0, *(2 * float(page_trend_test(one).pvalue) for one in (blocks, blocks[:, ::-1])))


def critical(seeds: int, comparisons: int = 1) -> float:
    """Returns the standard errors that a 95% interval over so many seeds reaches to each side.

    Args:
        seeds: their number.
        comparisons: the number that the interval is corrected for (Bonferroni).
    """
    return float(stdtrit(seeds - 1, 1 - _TAIL / comparisons))


def _spearman(rising: IntArray, values: FloatArray) -> float:
    """Spearman's correlation; 0 of values that are all equal."""
    return 0.0 if np.ptp(values) == 0 else float(spearmanr(rising, values).statistic)


def _checked(outcomes: ArrayLike) -> FloatArray:
    episodes = real("outcomes", outcomes)
    if episodes.ndim != 2 or not episodes.size or not ((episodes >= 0) & (episodes <= 1)).all():
        raise InputError(
            f"outcomes need the axes (R, N) and numbers from 0 to 1, got shape {episodes.shape}"
        )
    return episodes


def _basis(episodes: FloatArray) -> str:
    """What an interval of outcomes (R, N) or (R, N, methods) speaks of."""
    if len(episodes) == 1:
        return ONE_SEED
    alike = (episodes == episodes[0, 0]).all()
    return ALIKE if alike else OVER_SEEDS


class _Seeds:
    """The mean of rates (R,), its standard error, and how far it may be off on the logit scale."""

    def __init__(self, rates: FloatArray) -> None:
        self.mean = float(rates.mean())
        self.error = float(rates.std(ddof=1)) / sqrt(len(rates))

    def ends(self, errors: float) -> tuple[float, float]:
        """Returns the ends that are so many standard errors away."""
        if self.mean in (0, 1):
            return self.mean, self.mean
        away = errors * self.error / (self.mean * (1 - self.mean))
        return float(expit(logit(self.mean) - away)), float(expit(logit(self.mean) + away))


class PairedSeeds:
    """The interval over seeds of a difference of rates, paired by seed."""

    def __init__(self, left: FloatArray, right: FloatArray) -> None:
        """Takes each seed's rates (R,) of two methods."""
        self.left, self.right, self.paired = _Seeds(left), _Seeds(right), _Seeds(left - right)
        self.freedom = len(left) - 1

    def ends(self, errors: float) -> tuple[float, float]:
        """Returns the ends that are so many standard errors away: the wider of two scales."""
        low, high = self.logit_ends(errors)
        value, plain = self.paired.mean, errors * self.paired.error
        return max(-1.0, min(low, value - plain)), min(1.0, max(high, value + plain))

    def logit_ends(self, errors: float) -> tuple[float, float]:
        """Returns the ends that follow from those of the two rates on the logit scale.

        The rates' own ends are squared and added as if they were not paired, and the sum is scaled
        by what pairing does to the standard error.
        """
        unpaired = hypot(self.left.error, self.right.error)
        scale = self.paired.error / unpaired if unpaired > _ROUNDING else 0.0
        left, right = self.left.ends(errors), self.right.ends(errors)
        below = hypot(self.left.mean - left[0], right[1] - self.right.mean)
        above = hypot(left[1] - self.left.mean, self.right.mean - right[0])
        return self.paired.mean - scale * below, self.paired.mean + scale * above

    def p(self, margin: float) -> float:
        """Returns 1 less the confidence at which the interval ends at the margin."""
        away = abs(self.paired.mean - margin)
        if away < _ROUNDING or self.paired.error < _ROUNDING:
            return float(away < _ROUNDING)
        side, most = 0 if margin < self.paired.mean else 1, 1.001 * away / self.paired.error
        errors = brentq(lambda errors: self.ends(errors)[side] - margin, 0, most)
        return float(2 * stdtr(self.freedom, -errors))


def _over_starts(gaps: FloatArray, margin: float, tail: float) -> tuple[float, float, float]:
    """The interval and p-value of Agresti and Min, of differences (R, N) from -1 to 1.

    They add one start from which only the left succeeds, and one for the right, each half.
    """
    episodes = gaps.size + 2
    value = float(gaps.sum()) / episodes
    error = sqrt((((gaps**2).sum() + 1) / episodes - value**2) / episodes)
    half = ndtri(1 - tail) * error
    p = 2 * ndtr(-abs(value - margin) / error)
    return float(max(-1, value - half)), float(min(1, value + half)), float(p)
