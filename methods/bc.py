"""BC: behaviour cloning, a network from each state to the action that was taken there.

The policy is u(t) = MLP(x(t)), trained by the mean squared error of the actions (Pomerleau,
"ALVINN: An Autonomous Land Vehicle in a Neural Network", 1988). It is not in the paper.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from torch import Tensor

from methods.action_network import ActionConfig, ActionNetwork, Rngs
from methods.layers import Weights, mlp, mlp_weights
from tasks.data import FloatArray


@dataclass(frozen=True, kw_only=True)
class BCConfig(ActionConfig):
    """The settings of behaviour cloning."""

    learning_rate: float = 3e-3


class BC(ActionNetwork):
    """One action for each state."""

    name = "bc"
    summary = "behaviour cloning, from state to action"
    sizes: ClassVar[Mapping[str, BCConfig]] = {
        "small": BCConfig(hidden=(128, 128)),
        "median": BCConfig(hidden=(256, 256)),
        "large": BCConfig(hidden=(512, 512)),
    }
    default_size: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("tool", "door", "relocation", "reorientation"), "median"
    )

    def draw(self, rng: np.random.Generator) -> dict[str, FloatArray]:
        """Returns the layers from D numbers to a chunk of actions."""
        widths = (self.layout.state_dim, *self.config.hidden, self.length * self.layout.action_dim)
        return mlp_weights(rng, "layer", widths)

    def loss(self, weights: Weights, x: Tensor, u: Tensor, *noise: Tensor) -> Tensor:
        """Returns the mean squared error of the chunks, (S,)."""
        return (self._chunks_of(weights, x) - u).square().mean(dim=(1, 2))

    def predict(self, weights: Weights, x: Tensor, rngs: Rngs) -> Tensor:
        """Returns the chunks (1, B, C A)."""
        return self._chunks_of(weights, x)

    def _chunks_of(self, weights: Weights, x: Tensor) -> Tensor:
        return mlp(weights, "layer", x, len(self.config.hidden) + 1)
