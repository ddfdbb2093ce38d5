"""The training loop of all networks of the suite: Adam on mini-batches.

Networks of several seeds are trained together (see `methods.layers`). Each has its own samples,
draws its own weights and its own order, and its result does not depend on the others.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np
import torch
from threadpoolctl import ThreadpoolController
from torch import Tensor
from torch.optim.adamw import adamw

from methods.base import check_above
from methods.layers import Weights, tensor
from tasks.data import FloatArray, generator
from tasks.errors import InputError, unknown_name

Draw = Callable[[np.random.Generator], dict[str, FloatArray]]
"""Returns one network's initial weights by name."""


VECTOR = 16
"""Number of float32 values in the vectors of the widest processors."""


class TrainingError(RuntimeError):
    """A training failed; the message gives the reason."""


class Loss(Protocol):
    """Maps weights (S, ...) and a mini-batch (S, B, ...) to the mean loss of each network, (S,)."""

    def __call__(self, weights: Weights, *batch: Tensor) -> Tensor:
        """Returns the losses."""


FRESH_ADAM = ("never", "epoch", "batch")


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """Length and step sizes of a training.

    Raises:
        InputError: a value is out of range.
    """

    epochs: int
    batch_size: int
    learning_rate: float
    decay: bool = False
    """Whether the learning rate falls linearly to zero at the end."""
    fresh_adam: str = "never"
    """When Adam's moments are reset. The published code resets them every ``batch`` (NN, LSTM; each
    step is then the learning rate times the gradient's sign) or every ``epoch`` (NDP)."""
    weight_decay: float = 0.0
    """Weight decay of AdamW. With 0 it is Adam."""

    def __post_init__(self) -> None:
        if self.fresh_adam not in FRESH_ADAM:
            raise unknown_name("time for a fresh Adam", self.fresh_adam, FRESH_ADAM)
        check_above(self, 0, "epochs", "batch_size", "learning_rate")
        if not self.weight_decay >= 0:
            raise InputError(f"weight_decay must be 0 or more, got {self.weight_decay!r}")


@dataclass(frozen=True)
class Trained:
    """The result of one seed's training."""

    weights: dict[str, FloatArray]
    losses: FloatArray
    """(epochs,) mean loss of each epoch."""
    validation: FloatArray
    """(epochs,) validation loss after each epoch; NaN without validation."""


def minimise(
    draw: Draw,
    loss: Loss,
    data: Iterable[Sequence[FloatArray]],
    schedule: Schedule,
    name: str,
    seeds: Sequence[int],
    validate: Callable[[Weights], Tensor] | None = None,
    at_once: int | None = None,
    start: Sequence[Mapping[str, FloatArray]] = (),
) -> list[Trained]:
    """Trains one network for each seed.

    Args:
        draw: returns the initial weights.
        loss: the training loss, in float32.
        data: for each seed, arrays whose first axis is its samples. All seeds have as many.
        schedule: epochs, batch size and learning rate.
        name: names the network. Its random numbers depend on the name and the seed.
        seeds: one seed for each network.
        validate: returns validation losses (S,). Weights of the epoch with the lowest loss are
            kept. Default: those of the last epoch with a finite loss.
        at_once: number of samples that pass through a network at a time; the gradients of larger
            mini-batches are summed piece by piece. Default: whole mini-batches.
        start: for each seed, the initial weights. Default: drawn ones.

    Raises:
        TrainingError: there are no samples, or some seed's loss was never finite.
    """
    samples, count = _joined(data, len(seeds))
    if not count:
        raise TrainingError(f"{name} has no samples to learn from")
    first = start or [draw(generator("weights", name, seed)) for seed in seeds]
    numbers, all_gradients, weights, gradients = _leaves(first)
    leaves = list(weights.values())
    orders = [generator("order", name, seed) for seed in seeds]

    steps = schedule.epochs * -(-count // schedule.batch_size)
    rates = (schedule.learning_rate * (1 - schedule.decay * step / steps) for step in range(steps))

    adam = _Adam(numbers, all_gradients, schedule.weight_decay)
    best = _Best(weights)
    with one_thread():
        for _ in range(schedule.epochs):
            drawn_order = [i * count + rng.permutation(count) for i, rng in enumerate(orders)]
            order = torch.from_numpy(np.stack(drawn_order))
            total = torch.zeros(len(seeds))
            if schedule.fresh_adam == "epoch":
                adam.reset()
            for rows in order.split(schedule.batch_size, dim=1):
                if schedule.fresh_adam == "batch":
                    adam.reset()
                all_gradients.zero_()
                for piece in rows.split(at_once or schedule.batch_size, dim=1):
                    losses = loss(weights, *(part[piece] for part in samples))
                    share = losses.sum() * (piece.shape[1] / rows.shape[1])
                    slopes = torch.autograd.grad(share, leaves, materialize_grads=True)
                    for gradient, slope in zip(gradients, slopes, strict=True):
                        gradient += slope
                    total += losses.detach() * piece.shape[1]
                adam.step(next(rates))
            with torch.no_grad():
                best.note(total / count, validate(weights) if validate else None)
    return best.chosen(seeds)


def _joined(data: Iterable[Sequence[FloatArray]], seeds: int) -> tuple[list[Tensor], int]:
    """Returns the samples of all seeds one after the other, and how many a seed has.

    Raises:
        TrainingError: some seed has more samples than another.
    """
    parts = [[tensor(array) for array in arrays] for arrays in data]
    counts = [len(part[0]) for part in parts]
    if counts != seeds * counts[:1]:
        raise TrainingError(f"seeds that train together need as many samples each, got {counts}")
    return [torch.cat(column) for column in zip(*parts, strict=True)], counts[0]


def _leaves(
    drawn: Sequence[Mapping[str, FloatArray]],
) -> tuple[Tensor, Tensor, Weights, list[Tensor]]:
    """Returns all numbers and their gradient for Adam, the weights (S, ...) and their gradients.

    Weights and gradients are views of the first two: a step of Adam on one tensor costs less than a
    step on each. torch's fused Adam rounds the numbers after the last full vector differently, so
    each network's numbers are padded to full vectors.
    """
    arrays = {key: np.stack([one[key] for one in drawn]) for key in drawn[0]}
    rows = [array.reshape(len(drawn), -1) for array in arrays.values()]
    filled = [np.pad(part, ((0, 0), (0, -part.shape[1] % VECTOR))) for part in rows]
    numbers = tensor(np.concatenate([part.ravel() for part in filled]))
    gradient = torch.zeros_like(numbers)

    def views(flat: Tensor) -> list[Tensor]:
        parts = flat.split([part.size for part in filled])
        return [
            part.view(len(drawn), -1)[:, : row.shape[1]].view(array.shape)
            for part, row, array in zip(parts, rows, arrays.values(), strict=True)
        ]

    weights = [weight.requires_grad_() for weight in views(numbers)]
    return numbers, gradient, dict(zip(arrays, weights, strict=True)), views(gradient)


class _Adam:
    """AdamW of one tensor, with the defaults of `torch.optim.AdamW`.

    It calls torch's function, since making an object of that class loads torch's compiler, which
    takes longer than a short training.
    """

    def __init__(self, numbers: Tensor, gradient: Tensor, weight_decay: float) -> None:
        """Takes the numbers, the place of their gradient and the weight decay."""
        self._numbers, self._gradient, self._weight_decay = numbers, gradient, weight_decay
        self._moments = torch.zeros_like(numbers), torch.zeros_like(numbers)
        self._steps = torch.tensor(0.0)

    def reset(self) -> None:
        """Forgets all steps."""
        for part in (*self._moments, self._steps):
            part.zero_()

    def step(self, rate: float) -> None:
        """Makes one step with a learning rate."""
        mean, square = self._moments
        adamw(
            [self._numbers],
            [self._gradient],
            [mean],
            [square],
            [],
            [self._steps],
            fused=True,
            amsgrad=False,
            beta1=0.9,
            beta2=0.999,
            lr=rate,
            weight_decay=self._weight_decay,
            eps=1e-8,
            maximize=False,
        )


class _Best:
    """Keeps the best weights of each network so far."""

    def __init__(self, weights: Weights) -> None:
        self._weights = weights
        self._kept = {key: weight.detach().clone() for key, weight in weights.items()}
        self._lowest = torch.full_like(next(iter(self._kept.values())).flatten(1)[:, 0], torch.inf)
        self._losses: list[Tensor] = []
        self._validation: list[Tensor] = []

    def note(self, losses: Tensor, validation: Tensor | None) -> None:
        """Stores the current weights of each network that has improved."""
        if validation is None:
            better = losses.isfinite()
            validation = torch.full_like(losses, torch.nan)
            self._lowest[better] = 0.0
        else:
            better = validation < self._lowest
            self._lowest[better] = validation[better]
        for key, weight in self._weights.items():
            self._kept[key][better] = weight.detach()[better]
        self._losses.append(losses)
        self._validation.append(validation)

    def chosen(self, seeds: Sequence[int]) -> list[Trained]:
        """Returns the kept weights and all losses of each seed."""
        finite = self._lowest.isfinite()
        for kept in self._kept.values():
            finite &= kept.flatten(1).isfinite().all(dim=1)
        for seed, sound in zip(seeds, finite.tolist(), strict=True):
            if not sound:
                raise TrainingError(f"the loss of seed {seed} was never finite, or its weights")
        losses, validation = (
            torch.stack(rows, dim=1).double().numpy() for rows in (self._losses, self._validation)
        )
        return [
            Trained(
                {key: array[i].numpy().copy() for key, array in self._kept.items()},
                losses[i],
                validation[i],
            )
            for i in range(len(seeds))
        ]


@contextmanager
def one_thread() -> Iterator[None]:
    """Runs torch and BLAS on one thread, which gives the same bits whatever the machine has."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with _blas().limit(limits=1, user_api="blas"):
            yield
    finally:
        torch.set_num_threads(before)


@cache
def _blas() -> ThreadpoolController:
    """NumPy's BLAS. To look for it takes longer than to answer a control step."""
    return ThreadpoolController()
