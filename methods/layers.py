"""Layers of several networks side by side: one for each seed, trained in the same operations.

Weights are tensors by name whose first axis S counts the networks. A layer's result for one
network does not depend on the others.
"""

from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

from tasks.data import FloatArray

Weights = dict[str, Tensor]


def linear_weights(
    rng: np.random.Generator, name: str, inputs: int, outputs: int
) -> dict[str, FloatArray]:
    """Returns the weights of a linear layer, uniform within 1 / sqrt(inputs) as in torch."""
    bound = inputs**-0.5
    return {
        f"{name}.weight": rng.uniform(-bound, bound, (outputs, inputs)),
        f"{name}.bias": rng.uniform(-bound, bound, outputs),
    }


def linear(weights: Weights, name: str, x: Tensor) -> Tensor:
    """Returns (S, B, K) of inputs (S, B, I)."""
    weight, bias = weights[f"{name}.weight"], weights[f"{name}.bias"]
    return torch.baddbmm(bias[:, None], x, weight.transpose(1, 2))


def after(weights: Weights, name: str, layer: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
    """Returns weight and bias of the one layer that the layer of a name, then another, make."""
    weight, bias = layer
    inner = weights[f"{name}.bias"][:, :, None]
    return torch.bmm(weight, weights[f"{name}.weight"]), bias + torch.bmm(weight, inner)[..., 0]


def mlp_weights(
    rng: np.random.Generator, name: str, widths: tuple[int, ...]
) -> dict[str, FloatArray]:
    """Returns the weights of linear layers from each width to the next."""
    arrays: dict[str, FloatArray] = {}
    for i, (inputs, outputs) in enumerate(pairwise(widths)):
        arrays |= linear_weights(rng, f"{name}{i}", inputs, outputs)
    return arrays


def mlp(weights: Weights, name: str, x: Tensor, depth: int) -> Tensor:
    """Returns (S, B, K) of inputs (S, B, I): depth linear layers, ReLU between them."""
    for i in range(depth):
        x = linear(weights, f"{name}{i}", x)
        x = torch.relu(x) if i < depth - 1 else x
    return x
