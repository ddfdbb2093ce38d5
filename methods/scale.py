"""Standardised states: mean 0 and standard deviation 1 over the training demonstrations."""

from collections.abc import Mapping
from typing import NamedTuple, Self

import numpy as np

from tasks.data import FloatArray

SCALE_FLOOR = 1e-2
"""Smallest divisor of a state in standardisation, so that components that hardly move do not become
noise."""


class Scale(NamedTuple):
    """The mean and the scale of states, or of actions, (D,) each."""

    mean: FloatArray
    scale: FloatArray

    @classmethod
    def of(cls, states: FloatArray, standardise: bool) -> Self:
        """Returns the scale of states (N, T, D); one that changes nothing if not to standardise."""
        if not standardise:
            return cls(np.zeros(states.shape[-1]), np.ones(states.shape[-1]))
        return cls(states.mean(axis=(0, 1)), np.maximum(states.std(axis=(0, 1)), SCALE_FLOOR))

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, FloatArray], kind: str = "state") -> Self:
        """Returns the scale that is stored among parameters, see `arrays`."""
        return cls(arrays[f"{kind}_mean"], arrays[f"{kind}_scale"])

    def arrays(self, kind: str = "state") -> dict[str, FloatArray]:
        """Returns both by the names that parameters store them by.

        Args:
            kind: what is scaled.
        """
        return {f"{kind}_{name}": array for name, array in self._asdict().items()}

    def apply(self, states: FloatArray) -> FloatArray:
        """Returns standardised states (..., D) of states (..., D)."""
        scaled: FloatArray = (states - self.mean) / self.scale
        return scaled

    def undo(self, states: FloatArray) -> FloatArray:
        """Returns the states (..., K) of standardised ones, the first K of their components."""
        width = states.shape[-1]
        raw: FloatArray = states * self.scale[:width] + self.mean[:width]
        return raw
