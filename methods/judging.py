"""How the rules compare answers of a method."""

from collections.abc import Iterator

import numpy as np

from methods.base import Method
from methods.subject import Subject
from tasks.data import BoolArray, FloatArray
from tasks.rule_results import UntriedError

MORE_EPOCHS = (20, 80)
"""Upper bounds of ``epochs`` that are tried in turn if fewer do not show that a method learns."""
TOLERANCE = 1e-3
"""Largest difference between answers that should be equal except for rounding."""


def finite_part(subject: Subject) -> BoolArray | None:
    """Which numbers of the first answer are finite; None for all.

    The rule `finite` reports the others, so the other rules leave them out.
    """
    finite = np.isfinite(subject.answer())
    if not finite.any():
        raise UntriedError("finite")
    return None if finite.all() else finite


def difference(subject: Subject, first: FloatArray, second: FloatArray) -> float:
    """The largest difference of two answers; infinite where only one is finite."""
    known = finite_part(subject)
    if first.shape != second.shape:
        return np.inf
    if known is not None and known.shape == first.shape:
        known = known & np.isfinite(first) & np.isfinite(second)
        first, second = first[known], second[known]
    if np.array_equal(first, second, equal_nan=True):
        return 0.0
    differ = np.nan_to_num(np.abs(first - second), nan=np.inf)
    return float(differ.max())


def mean_error(given: FloatArray, wanted: FloatArray) -> float:
    """The mean absolute error of answers where they are finite; infinite if they nowhere are."""
    differ = np.abs(given[..., : wanted.shape[-1]] - wanted)
    known = np.isfinite(differ)
    return float(differ[known].mean()) if known.any() else np.inf


def longer(subject: Subject) -> Iterator[Method]:
    """The shared fit, then fits with more epochs, if the config has any."""
    yield subject.load()
    for epochs in MORE_EPOCHS:
        if subject.values(epochs) != subject.values():
            (found,) = subject.fits(epochs=epochs)
            yield found.learnt.method
