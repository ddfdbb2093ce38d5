"""NGF as published: a causal transformer outputs the whole motion, with one correction per step.

The published implementation does not integrate. Every token is the start [q(1), x_o(1)] plus a
positional code; four transformer blocks map the tokens to the belief b(t), t = 1..T. With the
differences q' = (b(t) - b(t-1)) / dt, the correction of each step is

    q'' = -P h - grad V + d^2 q',    h = |q'|^2 a(q),  V = |p(q)|^2,  P = I - q' q'^T / |q'|^2

(with the damping's sign of the published code), and the motion is 2 b(t) - b(t-1) + dt^2 q''. The
metrics M and M_f do not occur. As in the published code, no gradient flows through q and q' into a
and grad V. The warm-up, whose length is not known, and beta_2 = 0.95 are left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from methods.base import check_above
from methods.layers import Weights, linear
from methods.network import NetworkConfig, NetworkMethod
from tasks.data import CONTROL_STEP, FloatArray
from tasks.errors import InputError
from tasks.product import product

BLOCKS, HEADS = 4, 4
CORRECTIONS = ("geometry", "potential", "damping")


@dataclass(frozen=True, kw_only=True)
class PublishedNGFConfig(NetworkConfig):
    """Layers are those of Table 5, with the embedding of the published transformer."""

    hidden: tuple[int, int]
    embedding: int
    standardise: bool = False
    decay: bool = False
    epochs: int = 1000
    """The published limit is 10,000, with all demonstrations in one batch."""
    batch_size: int = 200
    learning_rate: float = 1e-3
    weight_decay: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        check_above(self, 0, "hidden", "embedding")
        if self.embedding % HEADS:
            raise InputError(f"embedding must be a multiple of {HEADS}, got {self.embedding}")


class PublishedNGF(NetworkMethod):
    """The transformer and the correction of its motion."""

    name = "ngf"
    version = 5
    summary = "causal transformer with one corrected step"
    at_once = 40
    """The activations of all demonstrations, 143 MB per layer, would not fit a processor cache."""
    sizes: ClassVar[Mapping[str, PublishedNGFConfig]] = {
        "small": PublishedNGFConfig(hidden=(64, 32), embedding=32),
        "median": PublishedNGFConfig(hidden=(128, 64), embedding=64),
        "large": PublishedNGFConfig(hidden=(256, 128), embedding=128),
    }
    default_size: ClassVar[Mapping[str, str]] = {
        "tool": "small",
        "door": "median",
        "relocation": "small",
        "reorientation": "small",
    }
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {"published": {}}

    def draw(self, rng: np.random.Generator) -> dict[str, FloatArray]:
        """Returns weights from normal distributions, and zero biases."""
        dim, joints, width = self.layout.state_dim, self.layout.robot_dim, self.config.embedding
        arrays = _normal_linear(rng, "into", dim, width, 0.02)
        for block in range(BLOCKS):
            for part in ("query", "key", "value", "join"):
                arrays |= _normal_linear(rng, f"{part}{block}", width, width, 0.02)
            arrays |= _normal_linear(rng, f"wide{block}", width, 4 * width, 0.02)
            arrays |= _normal_linear(rng, f"narrow{block}", 4 * width, width, 0.02)
            arrays |= _layer_norm(f"attended{block}", width) | _layer_norm(f"mixed{block}", width)
        arrays |= _normal_linear(rng, "out", width, joints, 0.02)
        first, second = self.config.hidden
        for name, outputs in zip(CORRECTIONS, (joints, joints, 1), strict=True):
            inputs = 2 * joints if name == "damping" else joints
            arrays |= _normal_linear(rng, f"{name}0", inputs, first, 0.01)
            arrays |= _normal_linear(rng, f"{name}1", first, second, 0.01)
            arrays |= _normal_linear(rng, f"{name}2", second, outputs, 0.01)
            arrays |= _layer_norm(f"{name}0", first) | _layer_norm(f"{name}1", second)
        return arrays

    def unroll(
        self, weights: Weights, start: Tensor, steps: int, truth: Tensor | None = None
    ) -> Tensor:
        """Returns the joints after each step."""
        belief = self._belief(weights, start, steps + 1)
        before, after = belief[:, :, :-1], belief[:, :, 1:]
        change = after - before
        acceleration = self._acceleration(weights, after, change / CONTROL_STEP)
        return after + change + CONTROL_STEP**2 * acceleration

    def error(self, weights: Weights, motion: Tensor) -> Tensor:
        """Returns the Huber loss of each network on the joints of states 2 to T, (S,)."""
        predicted = self.unroll(weights, motion[:, :, 0], motion.shape[2] - 1)
        wanted = motion[:, :, 1:, : predicted.shape[-1]]
        return functional.huber_loss(predicted, wanted, reduction="none").mean(dim=(1, 2, 3))

    def _belief(self, weights: Weights, start: Tensor, length: int) -> Tensor:
        networks, count = start.shape[:2]
        x = linear(weights, "into", start)[:, :, None] + _positions(length, self.config.embedding)
        for block in range(BLOCKS):
            x = _norm(weights, f"attended{block}", x + _attend(weights, block, x))
            wide = functional.gelu(_each(weights, f"wide{block}", x))
            x = _norm(weights, f"mixed{block}", x + _each(weights, f"narrow{block}", wide))
        return _each(weights, "out", x).view(networks, count, length, -1)

    def _acceleration(self, weights: Weights, q: Tensor, v: Tensor) -> Tensor:
        apart, moving = q.detach(), v.detach()
        geometry = moving.square().sum(dim=-1, keepdim=True) * _mlp(weights, "geometry", apart)
        along = (geometry * v).sum(dim=-1, keepdim=True)
        projected = geometry - v * along / (v.square().sum(dim=-1, keepdim=True) + 1e-15)
        with torch.enable_grad():
            place = apart.requires_grad_()
            potential = _mlp(weights, "potential", place).square().sum()
            (pull,) = torch.autograd.grad(potential, place, create_graph=True)
        damping = _mlp(weights, "damping", torch.cat([q, v], dim=-1)).square()
        return damping * v - projected - pull


def _normal_linear(
    rng: np.random.Generator, name: str, inputs: int, outputs: int, std: float
) -> dict[str, FloatArray]:
    weight = std * rng.standard_normal((outputs, inputs))
    return {f"{name}.weight": weight, f"{name}.bias": np.zeros(outputs)}


def _layer_norm(name: str, width: int) -> dict[str, FloatArray]:
    return {f"{name}.scale": np.ones(width), f"{name}.shift": np.zeros(width)}


def _norm(weights: Weights, name: str, x: Tensor) -> Tensor:
    """Layer normalisation of (S, B, T, K)."""
    normal = functional.layer_norm(x, x.shape[-1:])
    scale, shift = weights[f"{name}.scale"], weights[f"{name}.shift"]
    return torch.addcmul(shift[:, None, None], normal, scale[:, None, None])


def _each(weights: Weights, name: str, x: Tensor) -> Tensor:
    """Applies a linear layer to every token of (S, B, T, I)."""
    return linear(weights, name, x.flatten(1, 2)).unflatten(1, x.shape[1:3])


def _mlp(weights: Weights, name: str, x: Tensor) -> Tensor:
    for i in range(2):
        x = torch.relu(_norm(weights, f"{name}{i}", _each(weights, f"{name}{i}", x)))
    return _each(weights, f"{name}2", x)


def _attend(weights: Weights, block: int, x: Tensor) -> Tensor:
    """Causal self-attention of (S, B, T, E)."""
    query, key, value = (
        _each(weights, f"{part}{block}", x).unflatten(-1, (HEADS, -1)).transpose(2, 3)
        for part in ("query", "key", "value")
    )
    scores = product(query, key.mT * key.shape[-1] ** -0.5)
    shares = (scores + _future(x.shape[2])).softmax(dim=-1)
    return _each(weights, f"join{block}", product(shares, value).transpose(2, 3).flatten(-2))


@cache
def _future(length: int) -> Tensor:
    """Returns (T, T) with minus infinity where a token comes after the one that looks."""
    return torch.full((length, length), -torch.inf).triu(diagonal=1)


def _positions(length: int, width: int) -> Tensor:
    """Sinusoidal positional code, (T, E): sine in even channels, cosine in odd ones."""
    angle = torch.arange(length)[:, None] * 10_000 ** (-torch.arange(0, width, 2) / width)
    return torch.stack([angle.sin(), angle.cos()], dim=-1).flatten(1)
