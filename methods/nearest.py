"""Nearest: replays the demonstration whose start is nearest. The line that a method has to beat."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from methods.base import MotionMethod, NotFittedError, Parameters
from methods.motions import from_start
from methods.scale import Scale
from tasks.data import Demos, FloatArray


@dataclass(frozen=True)
class NearestConfig:
    """There is nothing to choose."""


class Nearest(MotionMethod):
    """Returns a demonstration as it is, but for its first state, which is the start."""

    name = "nearest"
    summary = "replays the demonstration with the nearest start"
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
        """Returns the motion of the demonstration nearest to each start, (B, steps + 1, D).

        Distances are Euclidean between standardised starts. Of several, the first is replayed.
        """
        motions = self._fitted()
        apart = self._scale.apply(start)[:, None] - self._scale.apply(motions[:, 0])
        chosen = np.square(apart).sum(axis=-1).argmin(axis=1)
        return from_start(start, motions[chosen], steps)

    def _keep(self, motions: FloatArray) -> None:
        self._motions, self._scale = motions, Scale.of(motions[:, :1], standardise=True)

    def _fitted(self) -> FloatArray:
        if self._motions is None:
            raise NotFittedError("this nearest has no demonstrations yet: call fit or load")
        return self._motions
