"""The contract of a method: it learns from demonstrations, then predicts motions or actions.

A method sees a task only as arrays. `tasks.data` defines the letters of their axes.
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
"""What a fit has learnt, as arrays by name. Nothing else of the fit is stored."""


def config_of(method: "type[Method]", size: str, variant: str) -> Any:
    """Returns the config of a method's size, with the fields that a variant sets."""
    return replace(method.sizes[size], **method.variants[variant])


def shortened(config: Any, epochs: int) -> Any:
    """Returns a config with its field ``epochs``, if it has one, limited to ``epochs``."""
    if "epochs" in {field.name for field in fields(config)}:
        return replace(config, epochs=min(config.epochs, epochs))
    return config


def machine_fields(config: Any) -> frozenset[str]:
    """Returns the fields of a config, or of its class, that say where a method computes, not what.

    They are declared with ``field(default="cpu", metadata={"of_machine": True})``. Results do not
    depend on them, so they are part of no key.
    """
    return frozenset(field.name for field in fields(config) if field.metadata.get("of_machine"))


def check_above(config: Any, bound: float, *names: str) -> None:
    """Checks that fields of a config, numbers or tuples of numbers, are above a bound.

    Raises:
        InputError: a number is not above the bound, or is NaN.
    """
    for name in names:
        value = getattr(config, name)
        numbers = value if isinstance(value, list | tuple) else [value]
        if not all(number > bound for number in numbers):
            raise InputError(f"{name} must be above {bound}, got {value!r}")


class NotFittedError(RuntimeError):
    """A method was called before `fit` or `load`."""


class Method(ABC):
    """The base of all methods. Subclass `MotionMethod` or `ActionMethod`, not this class."""

    name: ClassVar[str]
    summary: ClassVar[str]
    version: ClassVar[int] = 1
    """Raise it when predictions change. Stored results of other versions are not used."""
    sizes: ClassVar[Mapping[str, Any]]
    """Configs by the name of the size, the smallest first. A config is a frozen dataclass of
    numbers, texts and tuples."""
    default_size: ClassVar[Mapping[str, str]]
    """The size on each task if the experiment `sizes` has not chosen one. On other tasks it is what
    the task names, or else the smallest."""
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {"described": {}}
    """The config fields that each variant sets. ``described`` follows the paper's text;
    ``published``, if it exists, follows the authors' code."""
    validates: ClassVar[bool] = False
    """True if `fit` uses the validation demonstrations. The experiment ``efficiency`` then takes
    them out of the few demonstrations that it gives."""

    replans: ClassVar[bool] = False
    """True if it predicts a motion from any state, not only from a start. The experiment
    ``closed_loop`` then asks for a new one on the way."""

    def __init__(self, config: Any, layout: Layout) -> None:
        self.config = config
        self.layout = layout

    @abstractmethod
    def fit(self, demos: Demos, validation: Demos, seed: int) -> None:
        """Learns from demonstrations.

        Args:
            demos: the training demonstrations, with states (N, T, D). Do not write to them.
            validation: other demonstrations, for choosing a checkpoint.
            seed: the only source of randomness. The same seed gives the same result.
        """

    @classmethod
    def fit_seeds(
        cls,
        config: Any,
        layout: Layout,
        demos: Sequence[Demos],
        validation: Sequence[Demos],
        seeds: Sequence[int],
    ) -> list[Self]:
        """Returns a fitted method for each seed. Override it to train several seeds together.

        Args:
            config: the config of all.
            layout: the dimensions of the task.
            demos: for each seed, its training demonstrations. All seeds have as many.
            validation: for each seed, its validation demonstrations. All seeds have as many.
            seeds: the seeds.
        """
        methods = [cls(config, layout) for _ in seeds]
        for method, shown, unseen, seed in zip(methods, demos, validation, seeds, strict=True):
            method.fit(shown, unseen, seed)
        return methods

    @abstractmethod
    def parameters(self) -> Parameters:
        """Returns the arrays with which `load` restores the fit.

        Raises:
            NotFittedError: neither `fit` nor `load` was called.
        """

    @abstractmethod
    def load(self, parameters: Parameters) -> None:
        """Restores a fit from the arrays that `parameters` returned."""

    def diagnostics(self) -> Parameters:
        """Returns arrays that describe the fit, such as losses or eigenvalues. Default: none."""
        return {}


def fits_together(method: type[Method]) -> bool:
    """Returns whether a method overrides `fit_seeds` to train several seeds together."""
    return inspect.getattr_static(method, "fit_seeds") is not vars(Method)["fit_seeds"]


class MotionMethod(Method):
    """Predicts the whole motion from its start, without feedback. A controller tracks it."""

    @abstractmethod
    def rollout(self, start: FloatArray, steps: int) -> FloatArray:
        """Returns the predicted motion.

        Args:
            start: x(1), (B, D).
            steps: number of states after the start: those of a demonstration, or those that are
                left of it.

        Returns:
            (B, steps + 1, D), or (B, steps + 1, H) if the method predicts only the hand. The first
            row is the start.

        Raises:
            NotFittedError: neither `fit` nor `load` was called.
        """


class ActionMethod(Method):
    """Chooses an action in each state, with feedback."""

    @abstractmethod
    def reset(self, starts: FloatArray, rngs: Sequence[np.random.Generator]) -> None:
        """Prepares for episodes.

        Args:
            starts: the states at which they begin, (B, D).
            rngs: for each episode, the only source of randomness of its actions.
        """

    @abstractmethod
    def act(self, state: FloatArray, t: int) -> NDArray[np.floating[Any]]:
        """Returns the actions (B, A) in [-1, 1] for the states (B, D) after t control steps.

        Raises:
            NotFittedError: neither `fit` nor `load` was called.
        """
