"""Flow: chunks of actions drawn from a distribution that is learnt by flow matching.

A velocity field carries noise a(0) ~ N(0, I) to a chunk a(1) along straight lines,

    a(s) = (1 - s) a(0) + s a(1),    da/ds = v(a(s), s, x) = (f(a(s), s, x) - a(s)) / (1 - s),

and f is the network that minimises |f(a(s), s, x) - a(1)|^2 over demonstrations, noise and s
uniform in [0, 1]. The best f is the mean of a(1) given the rest, so that v is the mean of
a(1) - a(0), as in Lipman et al., "Flow Matching for Generative Modeling", 2023. A network for v
itself would have to pass on all of the noise, which has more numbers than its layers. A chunk is
drawn by Euler's method in a few steps of s, and its first actions are taken, as in `methods.chunk`.
It is not in the paper.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from methods.action_network import ActionNetwork, Rngs
from methods.base import check_above
from methods.chunk import ChunkConfig
from methods.layers import Weights, mlp, mlp_weights, tensor
from tasks.data import FloatArray, Layout

FREQUENCIES = 4
"""Number of sines, and of cosines, by which the network sees s."""


@dataclass(frozen=True, kw_only=True)
class FlowConfig(ChunkConfig):
    """The settings of flow matching."""

    length: int = 16
    horizon: int = 8
    steps: int = 5
    """Number of Euler steps from noise to a chunk."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_above(self, 0, "steps")


class Flow(ActionNetwork):
    """Chunks drawn by integrating a velocity field from noise."""

    version = 2
    name = "flow"
    summary = "flow matching over chunks of actions"
    sizes: ClassVar[Mapping[str, FlowConfig]] = {
        "small": FlowConfig(hidden=(128, 128)),
        "median": FlowConfig(hidden=(256, 256)),
        "large": FlowConfig(hidden=(512, 512)),
    }
    default_size: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("tool", "door", "relocation", "reorientation"), "median"
    )

    def __init__(self, config: FlowConfig, layout: Layout) -> None:
        super().__init__(config, layout)
        self.length, self.horizon = config.length, config.horizon

    def draw(self, rng: np.random.Generator) -> dict[str, FloatArray]:
        """Returns the layers from chunk, s and state to the chunk at s = 1."""
        chunk = self.length * self.layout.action_dim
        inputs = chunk + 2 * FREQUENCIES + self.layout.state_dim
        return mlp_weights(rng, "layer", (inputs, *self.config.hidden, chunk))

    def noise(self, rng: np.random.Generator, count: int) -> tuple[FloatArray, ...]:
        """Returns a(0), (B, C A), and s, (B, 1)."""
        chunk = self.length * self.layout.action_dim
        return rng.standard_normal((count, chunk)), rng.random((count, 1))

    def loss(self, weights: Weights, x: Tensor, u: Tensor, *noise: Tensor) -> Tensor:
        """Returns the mean squared error of f, (S,)."""
        start, s = noise
        found = self.end(weights, (1 - s) * start + s * u, s, x)
        return (found - u).square().mean(dim=(1, 2))

    def predict(self, weights: Weights, x: Tensor, rngs: Rngs) -> Tensor:
        """Returns chunks (1, B, C A) drawn for the states."""
        width = self.length * self.layout.action_dim
        chunk = tensor(np.stack([rng.standard_normal(width) for rng in rngs]))[None]
        for step in range(self.config.steps):
            s = torch.full_like(chunk[..., :1], step / self.config.steps)
            velocity = (self.end(weights, chunk, s, x) - chunk) / (1 - s)
            chunk = chunk + velocity / self.config.steps
        return chunk

    def end(self, weights: Weights, chunk: Tensor, s: Tensor, x: Tensor) -> Tensor:
        """Returns f, (S, B, C A), for chunks (S, B, C A), s (S, B, 1) and states (S, B, D)."""
        angles = torch.pi * s * torch.arange(1, FREQUENCIES + 1)
        inputs = torch.cat([chunk, angles.sin(), angles.cos(), x], dim=-1)
        return mlp(weights, "layer", inputs, len(self.config.hidden) + 1)
