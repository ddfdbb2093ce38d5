"""Layers of several networks side by side: one for each seed, trained in the same operations.

Weights are tensors by name whose first axis S counts the networks. A layer's result for one
network does not depend on the others.
"""

from itertools import pairwise

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import logsigmoid

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


def tensor(array: FloatArray) -> Tensor:
    """Returns an array in float32, in memory of torch's own.

    MKL rounds by where in memory numbers begin: those of torch begin at a full vector, those of
    NumPy anywhere.
    """
    return torch.tensor(array, dtype=torch.float32)


def linear(weights: Weights, name: str, x: Tensor) -> Tensor:
    """Returns (S, B, K) of inputs (S, B, I)."""
    weight, bias = weights[f"{name}.weight"], weights[f"{name}.bias"]
    if weight.shape[1] == 1:
        return bias[:, None] + _times_column(x, weight)
    return torch.baddbmm(bias[:, None], x, weight.transpose(1, 2))


def after(weights: Weights, name: str, layer: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
    """Returns weight and bias of the one layer that the layer of a name, then another, make."""
    weight, bias = layer
    inner = _times_column(weight, weights[f"{name}.bias"][:, None])
    return torch.bmm(weight, weights[f"{name}.weight"]), bias + inner[..., 0]


def _times_column(x: Tensor, column: Tensor) -> Tensor:
    """Returns (S, B, 1), x (S, B, I) times the column (S, 1, I).

    torch would multiply the column of a lone network by another operation than that of several.
    """
    return (x * column).sum(dim=2, keepdim=True)


def sigmoid(x: Tensor) -> Tensor:
    """Returns 1 / (1 + exp(-x)), rounded alike wherever a number stands in its tensor.

    torch's own rounds the numbers after the last full vector in another way, and with them those of
    the last network.
    """
    return 0.5 * torch.tanh(0.5 * x) + 0.5


def softplus(x: Tensor) -> Tensor:
    """Returns log(1 + exp(x)), rounded alike wherever a number stands, see `sigmoid`."""
    return -logsigmoid(-x)


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
