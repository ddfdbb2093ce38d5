"""The base of closed-loop networks: they learn what the demonstrations do in each state.

States and actions are standardised. A training sample is a state x(t) and its chunk, the next C
actions u(t), ..., u(t+C-1); a demonstration that ends earlier repeats its last action. The kept
weights are those with the lowest loss on the validation demonstrations.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from methods.base import ActionMethod, Parameters, check_above
from methods.layers import Weights, tensor
from methods.scale import Scale
from methods.trained import TrainedMethod
from methods.training import Schedule, minimise, one_thread
from tasks.data import Demos, FloatArray, Layout, generator

Rngs = Sequence[np.random.Generator]


@dataclass(frozen=True, kw_only=True)
class ActionConfig(Schedule):
    """Layers and training of a closed-loop network."""

    hidden: tuple[int, ...]
    decay: bool = True
    epochs: int = 100
    batch_size: int = 256
    learning_rate: float = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        check_above(self, 0, "hidden")


class ActionNetwork(TrainedMethod, ActionMethod):
    """A closed-loop method with a network. Its configs derive from `ActionConfig`."""

    length: int = 1
    """C, the number of actions that are learnt for a state."""
    horizon: int = 1
    """How many of them are taken before the next are asked for."""

    @abstractmethod
    def draw(self, rng: np.random.Generator) -> dict[str, FloatArray]:
        """Returns the initial weights of one network."""

    @abstractmethod
    def loss(self, weights: Weights, x: Tensor, u: Tensor, *noise: Tensor) -> Tensor:
        """Returns the loss of each network, (S,).

        Args:
            weights: the weights.
            x: standardised states, (S, B, D).
            u: their standardised chunks, (S, B, C A).
            noise: what `noise` drew for them, (S, B, ...).
        """

    @abstractmethod
    def predict(self, weights: Weights, x: Tensor, rngs: Rngs) -> Tensor:
        """Returns standardised chunks (1, B, C A) for states (1, B, D); rngs as in `reset`."""

    def noise(self, rng: np.random.Generator, count: int) -> tuple[FloatArray, ...]:
        """Returns the random numbers of a number of samples. Default: none."""
        return ()

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
        scales = [_Scales.of(of_seed) for of_seed in demos]
        samples = [
            scale.samples(of_seed, one.length) for scale, of_seed in zip(scales, demos, strict=True)
        ]
        unseen = [
            scale.samples(of_seed, one.length)
            for scale, of_seed in zip(scales, validation, strict=True)
        ]
        shown = [tensor(np.stack(arrays)) for arrays in zip(*unseen, strict=True)]
        rngs = [generator("noise", cls.name, seed) for seed in seeds]
        fixed = one._noises([generator("validation noise", cls.name, s) for s in seeds], shown[0])

        trained = minimise(
            draw=one.draw,
            loss=lambda weights, x, u: one.loss(weights, x, u, *one._noises(rngs, x)),
            data=samples,
            schedule=config,
            name=cls.name,
            seeds=seeds,
            validate=lambda weights: one.loss(weights, *shown, *fixed),
        )
        return cls._fitted(config, layout, trained, [scale.arrays() for scale in scales])

    def _noises(self, rngs: Rngs, x: Tensor) -> list[Tensor]:
        drawn = [self.noise(rng, x.shape[1]) for rng in rngs]
        return [tensor(np.stack(arrays)) for arrays in zip(*drawn, strict=True)]

    def reset(self, starts: FloatArray, rngs: Rngs) -> None:
        """Forgets the chunks of earlier episodes, and readies the weights once for all steps."""
        self._scales = _Scales.from_arrays(self.parameters())
        self._weights = self.weights(("state_", "action_"))
        self._rngs, self._chunks, self._since = rngs, np.empty(0), self.horizon

    def act(self, state: FloatArray, t: int) -> FloatArray:
        """Returns the next actions (B, A) of the chunks, new ones every `horizon` steps."""
        if self._since >= self.horizon:
            self._chunks, self._since = self._new_chunks(state), 0
        self._since += 1
        return self._chunks[:, self._since - 1]

    def _new_chunks(self, state: FloatArray) -> FloatArray:
        x = tensor(self._scales.states.apply(state))
        with one_thread(), torch.no_grad():
            found = self.predict(self._weights, x[None], self._rngs)[0].double().numpy()
        chunks = found.reshape(len(state), self.length, self.layout.action_dim)
        return np.clip(self._scales.actions.undo(chunks), -1.0, 1.0)


@dataclass(frozen=True)
class _Scales:
    """The standardisation of states and of actions."""

    states: Scale
    actions: Scale

    @classmethod
    def of(cls, demos: Demos) -> "_Scales":
        return cls(Scale.of(demos.states, True), Scale.of(demos.actions, True))

    @classmethod
    def from_arrays(cls, arrays: Parameters) -> "_Scales":
        return cls(Scale.of_arrays(arrays), Scale.of_arrays(arrays, "action"))

    def arrays(self) -> Parameters:
        return self.states.arrays() | self.actions.arrays("action")

    def samples(self, demos: Demos, length: int) -> tuple[FloatArray, FloatArray]:
        """Returns standardised states (N (T-1), D) and their chunks (N (T-1), C A)."""
        x, u = self.states.apply(demos.states[:, :-1]), self.actions.apply(demos.actions)
        steps = u.shape[1]
        taken = np.minimum(np.arange(steps)[:, None] + np.arange(length), steps - 1)
        return x.reshape(-1, x.shape[-1]), u[:, taken].reshape(len(x) * steps, -1)
