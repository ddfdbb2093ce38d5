"""Layers of several networks, one for each seed, that are trained in the same operations.

Weights are tensors by name. Their first axis, S, is the networks. The result of a layer for one
network does not depend on the others.
"""

from itertools import pairwise

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import logsigmoid

from tasks.data import FloatArray
from tasks.product import product

Weights = dict[str, Tensor]


def linear_weights(
    rng: np.random.Generator, name: str, inputs: int, outputs: int
) -> dict[str, FloatArray]:
    """Returns the weights of a linear layer, uniform within 1 / sqrt(inputs) like torch's."""
    bound = inputs**-0.5
    return {
        f"{name}.weight": rng.uniform(-bound, bound, (outputs, inputs)),
        f"{name}.bias": rng.uniform(-bound, bound, outputs),
    }


def tensor(array: FloatArray) -> Tensor:
    """Returns an array as float32, in memory that torch allocates.

    Results of some kernels depend on the alignment of the memory. torch aligns its memory to full
    vectors, NumPy does not.
    """
    return torch.tensor(array, dtype=torch.float32)


def linear(weights: Weights, name: str, x: Tensor) -> Tensor:
    """Applies a linear layer to (S, B, I); returns (S, B, K)."""
    weight, bias = weights[f"{name}.weight"], weights[f"{name}.bias"]
    if weight.shape[1] == 1:
        return bias[:, None] + _times_column(x, weight)
    return product(x, weight.mT) + bias[:, None]


def after(weights: Weights, name: str, layer: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
    """Returns weight and bias of a layer equal to the named layer followed by another one."""
    weight, bias = layer
    inner = _times_column(weight, weights[f"{name}.bias"][:, None])
    return product(weight, weights[f"{name}.weight"]), bias + inner[..., 0]


def times(x: Tensor, matrix: Tensor) -> Tensor:
    """Returns x (S, ..., I) times one matrix (I, K) for all networks, (S, ..., K).

    Each network has a product of its own: in one product for all, the rows after the last full
    block are rounded differently, and so those of the last network.
    """
    rows = product(x.flatten(1, -2), matrix.expand(len(x), -1, -1))
    return rows.unflatten(1, x.shape[1:-1])


def _times_column(x: Tensor, column: Tensor) -> Tensor:
    """Returns (S, B, 1), x (S, B, I) times the column (S, 1, I).

    torch would use different operations for one network and for several.
    """
    return (x * column).sum(dim=2, keepdim=True)


def sigmoid(x: Tensor) -> Tensor:
    """Returns 1 / (1 + exp(-x)), rounded independently of a number's position in its tensor.

    torch's own function rounds the numbers after the last full vector differently, and so those of
    the last network.
    """
    return 0.5 * torch.tanh(0.5 * x) + 0.5


def softplus(x: Tensor) -> Tensor:
    """Returns log(1 + exp(x)), rounded independently of position, see `sigmoid`."""
    return -logsigmoid(-x)


def mlp_weights(
    rng: np.random.Generator, name: str, widths: tuple[int, ...]
) -> dict[str, FloatArray]:
    """Returns the weights of linear layers between successive widths."""
    arrays: dict[str, FloatArray] = {}
    for i, (inputs, outputs) in enumerate(pairwise(widths)):
        arrays |= linear_weights(rng, f"{name}{i}", inputs, outputs)
    return arrays


def mlp(weights: Weights, name: str, x: Tensor, depth: int) -> Tensor:
    """Applies ``depth`` linear layers with ReLU between them to (S, B, I); returns (S, B, K)."""
    for i in range(depth):
        x = linear(weights, f"{name}{i}", x)
        x = torch.relu(x) if i < depth - 1 else x
    return x
