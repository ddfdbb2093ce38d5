"""The one training loop: Adam on mini-batches, for every network of the suite."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from tasks.data import FloatArray, generator

Loss = Callable[..., Tensor]


class TrainingError(RuntimeError):
    """A training came to nothing, for the reason that the message gives."""


@dataclass(frozen=True)
class Schedule:
    """How long and in what steps a network is trained."""

    epochs: int
    batch_size: int
    learning_rate: float


def seeded(build: Callable[[], nn.Module], *parts: str | int) -> nn.Module:
    """Returns what build makes, its random weights drawn for what the parts name.

    torch initialises from its global stream, which is left as it was.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(int(generator("weights", *parts).integers(2**62)))
        return build()


def minimise(
    network: nn.Module, loss: Loss, data: tuple[Tensor, ...], schedule: Schedule, *parts: str | int
) -> FloatArray:
    """Trains a network in place to the end of its schedule; returns each epoch's mean loss.

    Args:
        network: whose parameters are trained.
        loss: called with a mini-batch of each tensor of data; returns its mean loss.
        data: tensors whose first axis counts the samples.
        schedule: epochs, batch size and learning rate.
        parts: name what is trained: the order of the samples is drawn for them.

    Raises:
        TrainingError: the loss is no longer finite.
    """
    shuffle = generator("shuffle", *parts)
    optimiser = torch.optim.Adam(network.parameters(), schedule.learning_rate, fused=True)
    history = np.empty(schedule.epochs)
    with _one_thread():
        for epoch in range(schedule.epochs):
            order = torch.from_numpy(shuffle.permutation(len(data[0])))
            batches = zip(*(part[order].split(schedule.batch_size) for part in data), strict=True)
            total = torch.zeros(())
            for batch in batches:
                optimiser.zero_grad()
                value = loss(*batch)
                value.backward()
                optimiser.step()
                total += value.detach() * len(batch[0])
            history[epoch] = total.item() / len(order)
            if not np.isfinite(history[epoch]):
                raise TrainingError(f"the loss of epoch {epoch + 1} is {history[epoch]}")
    return history


@contextmanager
def _one_thread() -> Iterator[None]:
    """Small batches gain nothing from threads, and one gives the same bits on any machine load."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
