"""Nearest: replays the demonstration from its nearest state. The line that a method has to beat."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from threadpoolctl import threadpool_limits

from methods.base import MotionMethod, NotFittedError, Parameters
from methods.scale import Scale
from tasks.data import Demos, FloatArray, IntArray


@dataclass(frozen=True)
class NearestConfig:
    """There is nothing to choose."""


class Nearest(MotionMethod):
    """Returns what a demonstration did from there on; at its end, it rests."""

    name = "nearest"
    summary = "replays the demonstration with the nearest state"
    replans = True
    sizes: ClassVar[Mapping[str, NearestConfig]] = {"single": NearestConfig()}
    default_size: ClassVar[Mapping[str, str]] = {}

    _motions: FloatArray | None = None
    """The demonstrations, (N, T, D)."""

    def fit(self, demos: Demos, validation: Demos, seed: int) -> None:
        """Keeps the demonstrations. Validation demonstrations and seed have no effect."""
        self._keep(demos.states)

    def parameters(self) -> Parameters:
        """Returns the demonstrations."""
        return {"motions": self._fitted()}

    def load(self, parameters: Parameters) -> None:
        """Restores the demonstrations."""
        self._keep(parameters["motions"])

    def rollout(self, start: FloatArray, steps: int) -> FloatArray:
        """Returns what followed the nearest demonstrated state, (B, steps + 1, D).

        Distances are Euclidean between standardised states. Of several, the first is replayed.
        """
        motions = self._fitted()
        length = motions.shape[1]
        which, when = np.divmod(self._nearest(start), length)
        shown = np.minimum(when[:, None] + np.arange(1, steps + 1), length - 1)
        return np.concatenate([start[:, None], motions[which[:, None], shown]], axis=1)

    def _nearest(self, start: FloatArray) -> IntArray:
        """The place of the nearest state among those of all demonstrations, one after another."""
        x = self._scale.apply(start)
        with threadpool_limits(1, "blas"):
            apart = self._lengths - 2 * x @ self._states.T  # but for |x|^2, the same for all
        return apart.argmin(axis=1)

    def _keep(self, motions: FloatArray) -> None:
        self._motions, self._scale = motions, Scale.of(motions, standardise=True)
        self._states = self._scale.apply(motions).reshape(-1, motions.shape[-1])
        self._lengths = np.square(self._states).sum(axis=1)

    def _fitted(self) -> FloatArray:
        if self._motions is None:
            raise NotFittedError("this nearest has no demonstrations yet: call fit or load")
        return self._motions
