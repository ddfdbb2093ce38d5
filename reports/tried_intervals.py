"""Intervals of a difference that were tried and are not in use, for `reports.coverage`.

All but the percentile bootstrap take rates (S, R) of two methods in S studies of R paired seeds,
and return ends (S,).
"""

import numpy as np
from scipy.stats import t

from reports.seed_statistics import PairedSeeds, critical
from tasks.data import BoolArray, FloatArray, generator

Ends = tuple[FloatArray, FloatArray]


def paired_t(left: FloatArray, right: FloatArray) -> Ends:
    """Returns the ends of the paired t."""
    gaps = left - right
    return _around(gaps.mean(axis=1), critical(gaps.shape[1]) * _error(gaps))


def welch(left: FloatArray, right: FloatArray) -> Ends:
    """Returns the ends of the unpaired t with Satterthwaite's degrees of freedom."""
    errors = np.stack([_error(left), _error(right)])
    both = (errors**2).sum(axis=0)
    freedom = (left.shape[1] - 1) * both**2 / np.maximum((errors**4).sum(axis=0), 1e-300)
    quantile = t.ppf(0.975, np.maximum(freedom, left.shape[1] - 1))
    return _around((left - right).mean(axis=1), quantile * np.sqrt(both))


def bootstrap_t(left: FloatArray, right: FloatArray, resamples: int = 999) -> Ends:
    """Returns the ends of the studentised bootstrap of the paired differences."""
    gaps = left - right
    rows = generator("bootstrap-t").integers(gaps.shape[1], size=(resamples, gaps.shape[1]))
    ends = []
    for study in gaps:
        drawn = study[rows]
        away = drawn.mean(axis=1) - study.mean()
        low, high = np.quantile(away / np.maximum(_error(drawn), 1e-9), [0.025, 0.975])
        ends.append((study.mean() - high * _error(study), study.mean() - low * _error(study)))
    return tuple(np.transpose(ends))


def logit_alone(left: FloatArray, right: FloatArray) -> Ends:
    """Returns the ends on the logit scale, without those of the paired t."""
    errors = critical(left.shape[1])
    pairs = zip(left, right, strict=True)
    return tuple(np.transpose([PairedSeeds(*pair).logit_ends(errors) for pair in pairs]))


def percentile_bootstrap(
    left: BoolArray, right: BoolArray, rng: np.random.Generator, resamples: int = 2000
) -> tuple[float, float]:
    """Returns the ends for one study whose seeds all share one controller and all starts.

    Seeds of each method and starts are drawn with replacement, the same starts for both methods.

    Args:
        left: (R, N) success of each seed from each start.
        right: (R, N) likewise of the other method.
        rng: draws the resamples.
        resamples: how many.
    """
    # Starts of the same outcomes are one: drawing how often each outcome comes up is far cheaper.
    kinds, counts = np.unique(np.concatenate([left, right]), axis=1, return_counts=True)
    weights = rng.multinomial(counts.sum(), counts / counts.sum(), size=resamples) / counts.sum()
    means = []
    for outcomes in np.split(kinds, 2):
        rates = weights @ outcomes.T.astype(np.float64)
        seeds = rng.integers(len(outcomes), size=rates.shape)
        means.append(np.take_along_axis(rates, seeds, axis=1).mean(axis=1))
    low, high = np.quantile(means[0] - means[1], [0.025, 0.975])
    return float(low), float(high)


def _error(rates: FloatArray) -> FloatArray:
    return rates.std(axis=-1, ddof=1) / np.sqrt(rates.shape[-1])


def _around(middle: FloatArray, half: FloatArray) -> Ends:
    return middle - half, middle + half
