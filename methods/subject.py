"""The subject of a check: one variant of a method, fitted to synthetic demonstrations.

A variant is built, fitted, stored and loaded by `methods.contract`, as in a run.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from methods.base import Method, config_of, shortened
from methods.contract import Learnt, build, fitted, loaded, resolved, stored
from methods.guard import guarded
from methods.registry import variant_class
from methods.toy import LAYOUT, answer, toy
from tasks.data import FloatArray

EPOCHS = 3
"""Upper bound of a config's ``epochs``, for rules that do not depend on how well it learns."""


@dataclass(frozen=True)
class SubjectFit:
    """What a subject has learnt with one seed."""

    fitted: Method
    """The object that was fitted."""
    learnt: Learnt
    """Its parameters, stored and loaded."""
    changed: tuple[str, ...]
    """The parts of the process that the fit changed."""


@dataclass(frozen=True)
class Subject:
    """One variant of a method in its smallest size."""

    method: type[Method]
    """The variant's class."""
    variant: str

    def values(self, epochs: int = EPOCHS) -> dict[str, Any]:
        """Returns the config's values, with at most so many ``epochs``."""
        smallest = next(iter(self.method.sizes))
        config = config_of(self.method, smallest, self.variant)
        return resolved(shortened(config, epochs))

    def build(self) -> Method:
        """Returns the method, not fitted."""
        return build(self.method, self.values(), LAYOUT)

    def fits(
        self, seeds: Sequence[int] = (1,), stream: str = "toy", epochs: int = EPOCHS
    ) -> list[SubjectFit]:
        """Returns one new fit for each seed, which has demonstrations of its own.

        Args:
            seeds: the seeds, which are fitted together.
            stream: seeds the global random streams.
            epochs: upper bound of the config's ``epochs``.

        Raises:
            ContractError: see `methods.contract.learn`.
        """
        values = self.values(epochs)
        with guarded("check", stream) as changed:
            demos = [toy(10 * seed, 12) for seed in seeds]
            validation = [toy(10 * seed + 1, 4) for seed in seeds]
            found = fitted(self.method, values, LAYOUT, demos, validation, seeds)
            learnt = [stored(one, values, LAYOUT) for one in found]
        return [SubjectFit(*parts, tuple(changed)) for parts in zip(found, learnt, strict=True)]

    def fit(self, seed: int = 1) -> SubjectFit:
        """Returns the fit with a seed, which all rules share."""
        return _fit(self, seed, 1)

    def refit(self) -> SubjectFit:
        """Returns a second fit with seed 1, which all rules share."""
        return _fit(self, 1, 2)

    def answer(self, seed: int = 1) -> FloatArray:
        """Returns the first answer of the shared fit, once it is stored and loaded."""
        return _answer(self, seed)

    def load(self, parameters: bytes | None = None) -> Method:
        """Returns a new object with stored parameters. Default: those of the shared fit."""
        content = self.fit().learnt.parameters if parameters is None else parameters
        return loaded(self.method, self.values(), LAYOUT, content)


def subjects(method: type[Method]) -> list[Subject]:
    """Returns every variant of a method."""
    return [Subject(variant_class(method, variant), variant) for variant in method.variants]


@cache
def _fit(subject: Subject, seed: int, time: int) -> SubjectFit:
    (found,) = subject.fits([seed])
    return found


@cache
def _answer(subject: Subject, seed: int) -> FloatArray:
    return answer(_fit(subject, seed, 1).learnt.method)
