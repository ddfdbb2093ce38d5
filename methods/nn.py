"""NN: a multilayer perceptron that maps each state to the next (appendix E)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from methods.base import check_above
from methods.layers import Weights, mlp, mlp_weights
from methods.network import NetworkConfig, NetworkMethod, windows
from tasks.data import FloatArray


@dataclass(frozen=True, kw_only=True)
class NNConfig(NetworkConfig):
    """Layers are those of Table 2; the rest is chosen on validation data."""

    hidden: tuple[int, ...]
    residual: bool = True
    """Whether the network outputs the change of the state instead of the next state."""
    window: int = 10
    """Number of consecutive states predicted in training."""
    epochs: int = 100
    batch_size: int = 32
    learning_rate: float = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        check_above(self, 0, "hidden", "window")


class NN(NetworkMethod):
    """x(t+1) = x(t) + MLP(x(t)); the published variant lacks the first term."""

    name = "nn"
    summary = "multilayer perceptron, one state after another"
    replans = True
    version = 2
    sizes: ClassVar[Mapping[str, NNConfig]] = {
        "small": NNConfig(hidden=(32, 64, 32)),
        "median": NNConfig(hidden=(64, 128, 64)),
        "large": NNConfig(hidden=(128, 256, 128)),
    }
    default_size: ClassVar[Mapping[str, str]] = {
        "tool": "small",
        "door": "large",
        "relocation": "small",
        "reorientation": "median",
    }

    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "described": {},
        "published": {
            "residual": False,
            "window": 1,
            "standardise": False,
            "decay": False,
            "teacher_forced": True,
            "fresh_adam": "batch",
            "epochs": 200,
            "batch_size": 8,
        },
    }

    def draw(self, rng: np.random.Generator) -> dict[str, FloatArray]:
        """Returns the layers from D to D numbers."""
        dim = self.layout.state_dim
        return mlp_weights(rng, "layer", (dim, *self.config.hidden, dim))

    def unroll(
        self, weights: Weights, start: Tensor, steps: int, truth: Tensor | None = None
    ) -> Tensor:
        """Returns the following states, each predicted from the previous one."""
        x, states = start, []
        for t in range(steps):
            x = x if truth is None else truth[:, :, t]
            change = mlp(weights, "layer", x, len(self.config.hidden) + 1)
            x = x + change if self.config.residual else change
            states.append(x)
        return torch.stack(states, dim=2)

    def samples(self, states: FloatArray) -> list[FloatArray]:
        """Returns all windows of the config's number of steps, (N, W + 1, D)."""
        return [windows(states, min(self.config.window, states.shape[1] - 1))]
