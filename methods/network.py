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

from methods.base import MotionMethod, NotFittedError, Parameters
from methods.layers import Weights, tensor
from methods.scale import Scale
from methods.training import Schedule, Trained, minimise, one_thread
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


class NetworkMethod(MotionMethod):
    """A motion method with a neural network. Its configs derive from `NetworkConfig`."""

    validates = True
    at_once: ClassVar[int | None] = None
    """Number of samples that pass through the network at a time in training, see `minimise`."""

    def __init__(self, config: Any, layout: Layout) -> None:
        super().__init__(config, layout)
        self._arrays: Parameters | None = None
        self._trained: Trained | None = None

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

    def fit(self, demos: Demos, validation: Demos, seed: int) -> None:
        """Trains one network."""
        (fitted,) = self.fit_seeds(self.config, self.layout, [demos], [validation], [seed])
        self._arrays, self._trained = fitted._arrays, fitted._trained

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
        methods = [cls(config, layout) for _ in seeds]
        one = methods[0]
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
        for method, result, scale in zip(methods, trained, scales, strict=True):
            method._arrays = result.weights | scale._asdict()
            method._trained = result
        return methods

    def parameters(self) -> Parameters:
        """Returns the weights and the scaling of states."""
        if self._arrays is None:
            raise NotFittedError(f"this {self.name} has no weights yet: call fit or load")
        return self._arrays

    def load(self, parameters: Parameters) -> None:
        """Restores the weights and the scaling of states."""
        self._arrays, self._trained = dict(parameters), None

    def rollout(self, start: FloatArray, steps: int) -> FloatArray:
        """Returns the motion from each start, (B, steps + 1, K)."""
        arrays = self.parameters()
        scale = Scale(arrays["state_mean"], arrays["state_scale"])
        weights = {
            name: tensor(array)[None]
            for name, array in arrays.items()
            if not name.startswith("state_")
        }
        x = tensor(scale.apply(start))
        with one_thread(), torch.no_grad():
            predicted = self.unroll(weights, x[None], steps)[0].double().numpy()
        first = start[:, None, : predicted.shape[-1]]
        return np.concatenate([first, scale.undo(predicted)], axis=1)

    def diagnostics(self) -> Parameters:
        """Returns, after a fit, the ``losses`` and ``validation_losses`` of each epoch."""
        if self._trained is None:
            return {}
        return {"losses": self._trained.losses, "validation_losses": self._trained.validation}


def windows(states: FloatArray, steps: int) -> FloatArray:
    """Returns all windows of steps + 1 states (..., steps + 1, D) in motions (B, T, D)."""
    views = np.lib.stride_tricks.sliding_window_view(states, steps + 1, axis=1)
    return np.moveaxis(views, -1, 2).reshape(-1, steps + 1, states.shape[-1])
