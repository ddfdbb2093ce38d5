"""NN: a multilayer perceptron that maps each state to the next (appendix E)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from methods.base import check_above
from methods.layers import Weights, mlp, mlp_weights
from methods.network import NetworkConfig, NetworkMethod, windows
from tasks.data import FloatArray


@dataclass(frozen=True, kw_only=True)
class NNConfig(NetworkConfig):
    """Table 2 gives the layers; the rest is chosen on validation data."""

    hidden: tuple[int, ...]
    residual: bool = True
    """Whether the network gives the change of the state, rather than the state."""
    window: int = 10
    """States predicted one after another in training."""
    epochs: int = 100
    batch_size: int = 128
    learning_rate: float = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        check_above(self, 0, "hidden", "window")


class NN(NetworkMethod):
    """x(t+1) = x(t) + MLP(x(t)); without the first term as published."""

    name = "nn"
    summary = "multilayer perceptron, one state after another"
    sizes: ClassVar[Mapping[str, NNConfig]] = {
        "small": NNConfig(hidden=(32, 64, 32)),
        "median": NNConfig(hidden=(64, 128, 64)),
        "large": NNConfig(hidden=(128, 256, 128)),
    }
    default_size: ClassVar[Mapping[str, str]] = {
        "tool": "small",
        "door": "median",
        "relocation": "median",
        "reorientation": "large",
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
        """Returns the layers from D to D."""
        dim = self.layout.state_dim
        return mlp_weights(rng, "layer", (dim, *self.config.hidden, dim))

    def unroll(
        self, weights: Weights, start: Tensor, steps: int, truth: Tensor | None = None
    ) -> Tensor:
        """Returns the states that follow, each from the one before."""
        x, states = start, []
        for t in range(steps):
            x = x if truth is None else truth[:, :, t]
            change = mlp(weights, "layer", x, len(self.config.hidden) + 1)
            x = x + change if self.config.residual else change
            states.append(x)
        return torch.stack(states, dim=2)

    def loss(self, weights: Weights, *sample: Tensor) -> Tensor:
        """Returns the mean squared error of each network on stretches (S, B, W + 1, D), (S,)."""
        (stretch,) = sample
        if self.config.teacher_forced or not self.config.residual:
            return self.error(weights, stretch)
        predicted = motion_with_gradient(weights, stretch[:, :, 0], stretch.shape[2] - 1)
        return (predicted - stretch[:, :, 1:]).square().mean(dim=(1, 2, 3))

    def samples(self, states: FloatArray) -> list[FloatArray]:
        """Returns all stretches of as many steps as the config says, (N, W + 1, D)."""
        return [windows(states, min(self.config.window, states.shape[1] - 1))]


def motion_with_gradient(weights: Weights, start: Tensor, steps: int) -> Tensor:
    """Returns the states (S, B, W, D) after starts (S, B, D), as the residual `NN.unroll` does.

    Its gradient, for the weights alone, is written out: that of each layer is one product over all
    steps, where autograd takes one a step and adds them.
    """
    motion: Tensor = _Motion.apply(start, steps, *weights.values())
    return motion


class _Motion(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, start: Tensor, steps: int, *arrays: Tensor) -> Tensor:
        layers, biases = arrays[::2], [bias[:, None] for bias in arrays[1::2]]
        seeds, batch, _ = start.shape
        seen = [start.new_empty(seeds, steps, batch, layer.shape[2]) for layer in layers]
        x, motion = start, []
        for states, *hidden in zip(*(part.unbind(1) for part in seen), strict=True):
            h = states.copy_(x)
            for layer, bias, after in zip(layers[:-1], biases[:-1], hidden, strict=True):
                h = torch.clamp_min(torch.baddbmm(bias, h, layer.mT), 0, out=after)
            x = x + torch.baddbmm(biases[-1], h, layers[-1].mT)
            motion.append(x)
        ctx.save_for_backward(*layers, *seen)
        return torch.stack(motion, dim=2)

    @staticmethod
    @once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, d_motion: Tensor) -> tuple[Tensor | None, ...]:
        depth = len(ctx.saved_tensors) // 2
        layers, seen = ctx.saved_tensors[:depth], ctx.saved_tensors[depth:]
        seeds, batch, steps, dim = d_motion.shape
        d_out = [torch.empty_like(hidden) for hidden in seen[1:]]
        d_out.append(d_motion.new_empty(seeds, steps, batch, dim))
        d_x = d_motion.new_zeros(seeds, batch, dim)
        of_steps = zip(*(part.unbind(1) for part in (*seen[1:], *d_out)), strict=True)
        for d_next, parts in zip(d_motion.unbind(2)[::-1], list(of_steps)[::-1], strict=True):
            hidden, (*d_hidden, d_last) = parts[: depth - 1], parts[depth - 1 :]
            d_x = d = torch.add(d_x, d_next, out=d_last)
            for layer, h, d_h in zip(layers[:0:-1], hidden[::-1], d_hidden[::-1], strict=True):
                d = torch.mul(torch.bmm(d, layer), h.sign(), out=d_h)
            d_x = torch.baddbmm(d_x, d, layers[0])
        gradients = [
            gradient
            for d, x in zip(d_out, seen, strict=True)
            for gradient in (
                torch.bmm(d.flatten(1, 2).mT, x.flatten(1, 2)),
                d.sum(dim=(1, 2)),
            )
        ]
        return None, None, *gradients
