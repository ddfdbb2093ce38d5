"""Intervals of a difference that were tried and are not in use, for `reports.coverage`.

Each takes rates (S, R) of two methods in S studies of R paired seeds, and returns ends (S,).
"""

import numpy as np
from scipy.stats import t

from reports.seed_statistics import PairedSeeds, critical
from tasks.data import FloatArray, generator

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


def _error(rates: FloatArray) -> FloatArray:
    return rates.std(axis=-1, ddof=1) / np.sqrt(rates.shape[-1])


def _around(middle: FloatArray, half: FloatArray) -> Ends:
    return middle - half, middle + half
