"""LSTM: a recurrent network that is fed its own predictions (appendix E)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from methods.layers import Weights, linear, linear_weights
from methods.network import NetworkConfig, NetworkMethod
from tasks.data import FloatArray


@dataclass(frozen=True, kw_only=True)
class LSTMConfig(NetworkConfig):
    """Table 3 gives the layers; the rest is chosen on validation data."""

    embedding: int
    """Units of the layer between the state and the LSTM."""
    hidden: int
    """Units of the LSTM."""
    epochs: int = 200
    batch_size: int = 16
    learning_rate: float = 1e-3


class LSTM(NetworkMethod):
    """A linear layer, an LSTM, a linear layer: from each state to the next."""

    name = "lstm"
    summary = "recurrent network, fed its own predictions"
    sizes: ClassVar[Mapping[str, LSTMConfig]] = {
        "small": LSTMConfig(embedding=100, hidden=200),
        "median": LSTMConfig(embedding=175, hidden=250),
        "large": LSTMConfig(embedding=250, hidden=300),
    }
    default_size: ClassVar[Mapping[str, str]] = {
        "tool": "median",
        "door": "small",
        "relocation": "large",
        "reorientation": "small",
    }

    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "described": {},
        "published": {
            "standardise": False,
            "teacher_forced": True,
            "fresh_adam": "batch",
            "epochs": 200,
            "batch_size": 4,
        },
    }

    def draw(self, rng: np.random.Generator) -> dict[str, FloatArray]:
        """Returns the three layers; the LSTM's has its four gates one below the other."""
        dim, embedding, hidden = self.layout.state_dim, self.config.embedding, self.config.hidden
        gates = linear_weights(rng, "gates", embedding + hidden, 4 * hidden)
        return (
            linear_weights(rng, "into", dim, embedding)
            | gates
            | linear_weights(rng, "out", hidden, dim)
        )

    def unroll(
        self, weights: Weights, start: Tensor, steps: int, truth: Tensor | None = None
    ) -> Tensor:
        """Returns the states that follow, from an empty memory."""
        x, states = start, []
        hidden = start.new_zeros(*start.shape[:2], self.config.hidden)
        cell = torch.zeros_like(hidden)
        for t in range(steps):
            x = x if truth is None else truth[:, :, t]
            seen = torch.cat([linear(weights, "into", x), hidden], dim=2)
            write, forget, new, show = linear(weights, "gates", seen).chunk(4, dim=2)
            cell = forget.sigmoid() * cell + write.sigmoid() * new.tanh()
            hidden = show.sigmoid() * cell.tanh()
            x = linear(weights, "out", hidden)
            states.append(x)
        return torch.stack(states, dim=2)
