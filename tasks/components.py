"""What a task's class declares: the numbers of its states and starts, and the ranges of these."""

from dataclasses import dataclass

import numpy as np

from tasks.data import BoolArray, FloatArray


@dataclass(frozen=True)
class Component:
    """One number of a state, a start or a reading."""

    name: str
    unit: str
    source: str
    """Where in the model it is read."""


@dataclass(frozen=True)
class Placed:
    """One part of an initial state in Minari's data sets, and its place in the model."""

    name: str
    """Its name in the data sets."""
    element: str
    """``body`` or ``site``."""
    of: str
    attribute: str


def xyz(name: str, unit: str, source: str) -> tuple[Component, ...]:
    """Returns the three components of a vector. ``{axis}`` in the source becomes x, y and z."""
    return tuple(Component(f"{name}_{axis}", unit, source.format(axis=axis)) for axis in "xyz")


@dataclass(frozen=True)
class Range:
    """A box from which starts are drawn uniformly."""

    low: tuple[float, ...]
    high: tuple[float, ...]

    def contains(self, values: FloatArray) -> BoolArray:
        """Returns whether each row of values (B, P) lies in the box, (B,)."""
        return np.all((values >= self.low) & (values <= self.high), axis=1)
