"""LSTM: a recurrent network that is fed its own predictions (appendix E)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from methods.base import check_above
from methods.layers import Weights, after, linear, linear_weights
from methods.network import NetworkConfig, NetworkMethod
from tasks.data import FloatArray


@dataclass(frozen=True, kw_only=True)
class LSTMConfig(NetworkConfig):
    """Layers are those of Table 3; the rest is chosen on validation data."""

    embedding: int
    """Number of units of the layer between the state and the LSTM."""
    hidden: int
    """Number of units of the LSTM."""
    decay: bool = False
    epochs: int = 400
    batch_size: int = 16
    learning_rate: float = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        check_above(self, 0, "embedding", "hidden")


class LSTM(NetworkMethod):
    """A linear layer, an LSTM and a linear layer map each state to the next."""

    name = "lstm"
    summary = "recurrent network, fed its own predictions"
    version = 3
    sizes: ClassVar[Mapping[str, LSTMConfig]] = {
        "small": LSTMConfig(embedding=100, hidden=200),
        "median": LSTMConfig(embedding=175, hidden=250),
        "large": LSTMConfig(embedding=250, hidden=300),
    }
    default_size: ClassVar[Mapping[str, str]] = {
        "tool": "small",
        "door": "small",
        "relocation": "small",
        "reorientation": "median",
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
        """Returns the three layers. The four gates of the LSTM are stacked in its rows."""
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
        """Returns the following states, starting with an empty memory."""
        embedding, hidden = self.config.embedding, self.config.hidden
        from_embedding, memory = weights["gates.weight"].split([embedding, hidden], dim=2)
        gates, bias = after(weights, "into", (from_embedding, weights["gates.bias"]))
        if truth is None:
            # All layers between the LSTM and the gates of the next step are linear, so they merge
            # into one: an LSTM whose only input is the start.
            again, bias = after(weights, "out", (gates, bias))
            memory = memory + again
            seen = start.new_zeros(*start.shape[:2], steps, start.shape[2])
            seen[:, :, 0] = start - weights["out.bias"][:, None]
        else:
            seen = truth[:, :, :steps]
        empty = start.new_zeros(1, start.shape[1], hidden)
        layers = zip(gates, memory, bias, torch.zeros_like(bias), strict=True)
        shown = [
            torch.lstm(x, (empty, empty), layer, True, 1, 0.0, True, False, True)[0]
            for x, layer in zip(seen, layers, strict=True)
        ]
        states = linear(weights, "out", torch.stack(shown).flatten(1, 2))
        return states.unflatten(1, (-1, steps))
