"""Method: learns from demonstrations, then answers start states with a motion or with actions.

A method sees a task only as arrays. The letters of their axes are defined in `tasks.data`.
"""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from tasks.data import Demos, FloatArray, Layout
from tasks.errors import InputError

Parameters = dict[str, NDArray[Any]]
"""What a fit has learnt: arrays by name, which is all that is stored of it."""


def shortened(config: Any, epochs: int) -> Any:
    """Returns a config with at most so many epochs, where it has such a field."""
    if "epochs" in {field.name for field in fields(config)}:
        return replace(config, epochs=min(config.epochs, epochs))
    return config


def check_above(config: Any, bound: float, *names: str) -> None:
    """Checks fields of a config: numbers, or tuples of them.

    Raises:
        InputError: a number is not above the bound.
    """
    for name in names:
        value = getattr(config, name)
        numbers = value if isinstance(value, list | tuple) else [value]
        if not all(number > bound for number in numbers):  # nor is NaN
            raise InputError(f"{name} must be above {bound}, got {value!r}")


class NotFittedError(RuntimeError):
    """A method was asked for an answer before `fit` or `load`."""


class Method(ABC):
    """What competes. Subclass `MotionMethod` or `ActionMethod`, not this class."""

    name: ClassVar[str]
    summary: ClassVar[str]
    version: ClassVar[int] = 1
    """Raise it when predictions change: stored results of other versions are left aside."""
    sizes: ClassVar[Mapping[str, Any]]
    """Configs by size name, the smallest first: frozen dataclasses of numbers, texts, tuples."""
    default_size: ClassVar[Mapping[str, str]]
    """The size for each task where no `sizes` experiment has chosen one."""
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {"described": {}}
    """Config fields that each variant sets. ``described`` follows the paper's text, and
    ``published``, where it exists, does what the authors' code does."""
    deterministic: ClassVar[bool] = False
    """Whether the seed changes nothing, so that one fit stands for all seeds."""

    def __init__(self, config: Any, layout: Layout) -> None:
        self.config = config
        self.layout = layout

    @abstractmethod
    def fit(self, demos: Demos, validation: Demos, seed: int) -> None:
        """Learns from demonstrations.

        Args:
            demos: the training demonstrations, (N, T, D) states and so on; not to be written to.
            validation: others, to choose a checkpoint by.
            seed: the only source of randomness; same seed, same result.
        """

    @classmethod
    def fit_seeds(
        cls, config: Any, layout: Layout, demos: Demos, validation: Demos, seeds: Sequence[int]
    ) -> list[Self]:
        """Returns one fitted method for each seed. Override it to train them together."""
        methods = [cls(config, layout) for _ in seeds]
        for method, seed in zip(methods, seeds, strict=True):
            method.fit(demos, validation, seed)
        return methods

    @abstractmethod
    def parameters(self) -> Parameters:
        """Returns what `load` needs to give the same answers.

        Raises:
            NotFittedError: there is nothing yet.
        """

    @abstractmethod
    def load(self, parameters: Parameters) -> None:
        """Takes what `parameters` returned, in place of a fit."""

    def diagnostics(self) -> Parameters:
        """Returns what is worth a look after a fit: eigenvalues, losses. Nothing unless told."""
        return {}


def fits_together(method: type[Method]) -> bool:
    """Returns whether a method trains several seeds together, by a `fit_seeds` of its own."""
    return inspect.getattr_static(method, "fit_seeds") is not vars(Method)["fit_seeds"]


class MotionMethod(Method):
    """Predicts the whole motion from its start, without feedback; a controller tracks it."""

    @abstractmethod
    def rollout(self, start: FloatArray, steps: int) -> FloatArray:
        """Returns the predicted motion.

        Args:
            start: x(1), (B, D).
            steps: how many states after the start.

        Returns:
            (B, steps + 1, D), or (B, steps + 1, H) of a method that predicts the hand alone. The
            first row is the start.

        Raises:
            NotFittedError: neither `fit` nor `load` came before.
        """


class ActionMethod(Method):
    """Answers each state with an action."""

    @abstractmethod
    def reset(self, starts: FloatArray) -> None:
        """Prepares for episodes that begin at the states (B, D)."""

    @abstractmethod
    def act(self, state: FloatArray, t: int) -> NDArray[np.floating[Any]]:
        """Returns the actions (B, A) in [-1, 1] for the states (B, D) after t control steps.

        Raises:
            NotFittedError: neither `fit` nor `load` came before.
        """
