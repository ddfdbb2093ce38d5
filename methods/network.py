"""The base of all networks: they predict a motion from its start and are trained to reproduce it.

States are standardised. A network is trained on windows of the demonstrations: it predicts each
window from its first state alone, and training minimises the mean squared error of the window, the
"trajectory reproduction error" of appendix E. The kept weights are those with the lowest error on
the validation demonstrations, predicted from their starts.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from methods.base import MotionMethod
from methods.layers import Weights, tensor
from methods.scale import Scale
from methods.trained import TrainedMethod
from methods.training import Schedule, minimise, one_thread
from tasks.data import Demos, FloatArray, Layout


@dataclass(frozen=True, kw_only=True)
class NetworkConfig(Schedule):
    """The training settings of all networks."""

    decay: bool = True
    standardise: bool = True
    """Whether states are scaled to mean 0 and standard deviation 1."""
    teacher_forced: bool = False
    """Whether each state is predicted from the demonstrated previous state, in training and
    validation, instead of from the network's own prediction."""


class NetworkMethod(TrainedMethod, MotionMethod):
    """A motion method with a neural network. Its configs derive from `NetworkConfig`."""

    at_once: ClassVar[int | None] = None
    """Number of samples that pass through the network at a time in training, see `minimise`."""

    @abstractmethod
    def draw(self, rng: np.random.Generator) -> dict[str, FloatArray]:
        """Returns the initial weights of one network."""

    @abstractmethod
    def unroll(
        self, weights: Weights, start: Tensor, steps: int, truth: Tensor | None = None
    ) -> Tensor:
        """Returns (S, B, steps, K) after starts (S, B, D), all standardised.

        K is D, or H for a network that predicts only the hand. A network that maps each state to
        the next takes the states of ``truth`` (S, B, T, D) as inputs, if it is given.
        """

    def samples(self, states: FloatArray) -> list[FloatArray]:
        """Returns the training samples from motions (N, T, D). Default: whole motions."""
        return [states]

    def loss(self, weights: Weights, *sample: Tensor) -> Tensor:
        """Returns the training loss of each network on some samples, (S,)."""
        return self.error(weights, *sample)

    def error(self, weights: Weights, motion: Tensor) -> Tensor:
        """Returns the mean squared error of each network on motions (S, B, T, D), (S,)."""
        truth = motion if self.config.teacher_forced else None
        predicted = self.unroll(weights, motion[:, :, 0], motion.shape[2] - 1, truth)
        wanted = motion[:, :, 1:, : predicted.shape[-1]]
        return (predicted - wanted).square().mean(dim=(1, 2, 3))

    @classmethod
    def fit_seeds(
        cls,
        config: Any,
        layout: Layout,
        demos: Sequence[Demos],
        validation: Sequence[Demos],
        seeds: Sequence[int],
    ) -> list[Self]:
        """Trains the networks of all seeds together, each on its own demonstrations."""
        one = cls(config, layout)
        scales = [Scale.of(of_seed.states, config.standardise) for of_seed in demos]
        unseen = tensor(
            np.stack([scale.apply(d.states) for scale, d in zip(scales, validation, strict=True)])
        )
        trained = minimise(
            draw=one.draw,
            loss=one.loss,
            data=(
                one.samples(scale.apply(d.states)) for scale, d in zip(scales, demos, strict=True)
            ),
            schedule=config,
            name=cls.name,
            seeds=seeds,
            validate=lambda weights: one.error(weights, unseen),
            at_once=cls.at_once,
        )
        return cls._fitted(config, layout, trained, [scale.arrays() for scale in scales])

    def rollout(self, start: FloatArray, steps: int) -> FloatArray:
        """Returns the motion from each start, (B, steps + 1, K)."""
        arrays = self.parameters()
        scale = Scale.of_arrays(arrays)
        x = tensor(scale.apply(start))
        with one_thread(), torch.no_grad():
            predicted = self.unroll(self.weights(("state_",)), x[None], steps)[0].double().numpy()
        first = start[:, None, : predicted.shape[-1]]
        return np.concatenate([first, scale.undo(predicted)], axis=1)


def windows(states: FloatArray, steps: int) -> FloatArray:
    """Returns all windows of steps + 1 states (..., steps + 1, D) in motions (B, T, D)."""
    views = np.lib.stride_tricks.sliding_window_view(states, steps + 1, axis=1)
    return np.moveaxis(views, -1, 2).reshape(-1, steps + 1, states.shape[-1])
