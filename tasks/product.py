"""Products of matrices in training, one for each network, by OpenBLAS.

torch's own are MKL's. Even in its compatible mode, which takes up to twice as long, they have other
bits where MKL takes the processor for another vendor's. A product of each network is a call of its
own, so that it does not depend on the others, nor on where its numbers lie in memory.
"""

from typing import Any

import numpy as np
import torch
from torch import Tensor


def product(left: Tensor, right: Tensor) -> Tensor:
    """Returns left (S, B, I) times right (S, I, K), (S, B, K), with gradients of any order."""
    found: Tensor = _Product.apply(left, right)
    return found


def plain_product(left: Tensor, right: Tensor) -> Tensor:
    """Returns the same without a gradient. As in torch, overflow gives infinity in silence."""
    with np.errstate(over="ignore", invalid="ignore"):
        return torch.from_numpy(np.matmul(left.numpy(), right.numpy()))


class _Product(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, left: Tensor, right: Tensor) -> Tensor:
        ctx.save_for_backward(left, right)
        return plain_product(left.detach(), right.detach())

    @staticmethod
    def backward(ctx: Any, slope: Tensor) -> tuple[Tensor | None, Tensor | None]:
        left, right = ctx.saved_tensors
        needs_left, needs_right = ctx.needs_input_grad
        return (
            product(slope, right.mT) if needs_left else None,
            product(left.mT, slope) if needs_right else None,
        )
