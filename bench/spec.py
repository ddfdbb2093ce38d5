"""Fits, evaluations and controllers as values, with the keys that identify their results.

A key hashes resolved values only. Order, paths, times and the number of episodes are not part of
it: more episodes extend the same evaluation.
"""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import mujoco

from bench.controller import ControllerConfig
from bench.controller_kinds import KINDS, ORIGINAL
from bench.labels import DIGITS
from bench.labels import EXPERT as EXPERT
from bench.labels import VALIDATION as VALIDATION
from bench.manifest import Name, Wanted
from bench.names import ADDED, PLAIN, controller_label, evaluation_name, fit_key, stored_fields
from methods.base import Method, fits_together, machine_fields
from methods.contract import build
from methods.registry import get_method
from tasks.base import SPLITS
from tasks.data import key
from tasks.demos import expert_of
from tasks.disturbances import UNDISTURBED, find_disturbances
from tasks.disturbances import VERSION as DISTURBANCES
from tasks.errors import InputError, unknown_name
from tasks.masses import NOMINAL
from tasks.pins import mark
from tasks.registry import APPENDIX, FIRST, get_task
from tasks.simulator import CHUNK

EVALUATION_SPLITS = (VALIDATION, *(split for split in SPLITS if split not in ("train", "demo")))


@dataclass(frozen=True)
class Fit:
    """A method with every value that affects what it learns."""

    task: str
    method: str
    variant: str
    size: str
    config: Mapping[str, Any]
    """Every field of the method's config."""
    demos: int
    """N: the first N training demonstrations are learnt from."""
    seed: int
    """Of the study: decides the demonstrations, the starts and the method's random numbers."""
    demos_key: str
    """Key of the demonstrations that all seeds share, see `tasks.demos.demos_key`."""
    settings: str = ""
    """Fields of the config that `--set` changed, such as ``hidden=64``, see `bench.labels`."""
    held_out: int = 0
    """How many training demonstrations after the first N validate, in place of the validation
    demonstrations. Default: none do."""
    expert: str = FIRST
    """Which of the task's experts made the demonstrations."""
    weights: str = ""
    """SHA-256 of the weights of a file, which take the place of training. Default: none do."""
    pins: str = field(default_factory=mark)
    """Whether the kernels that compute it are pinned, see `tasks.pins`."""

    @cached_property
    def key(self) -> str:
        """Identifies the fit, see `bench.names.fit_key`."""
        version = 0 if self.method == EXPERT else get_method(self.method, self.variant).version
        return fit_key(version, self.stored)

    @property
    def stored(self) -> dict[str, Any]:
        """Its `stored_fields`, without those of the config that say where the method computes."""
        values = stored_fields(asdict(self))
        if self.method != EXPERT:
            sizes = get_method(self.method, self.variant).sizes
            machine = machine_fields(next(iter(sizes.values())))
            values["config"] = {k: v for k, v in self.config.items() if k not in machine}
        return values

    @cached_property
    def of_expert(self) -> bool:
        """Whether its demonstrations are the expert's, as this installation makes them."""
        return bool(expert_of(get_task(self.task), self.demos_key, self.pins))

    @cached_property
    def label(self) -> str:
        """A readable name, for folders and messages.

        Two fits may share a label. The results then show the one that a run requested last.
        """
        taught = "" if self.expert == FIRST else self.expert
        if self.method == EXPERT:
            return "-".join(filter(None, (self.task, self.method, taught, f"s{self.seed}")))
        origin = taught if self.of_expert else self.demos_key[:DIGITS]
        weights = f"weights={self.weights[:DIGITS]}" if self.weights else ""
        parts = [self.task, self.method, self.settings, weights, self.variant, self.size]
        held_out = f"+{self.held_out}" if self.held_out else ""
        parts += [f"n{self.demos}{held_out}", origin, f"s{self.seed}"]
        return "-".join(part for part in parts if part)

    def build(self) -> Method:
        """Returns the method, not fitted.

        Raises:
            InputError: the method refuses the config.
        """
        method = get_method(self.method, self.variant)
        return build(method, self.config, get_task(self.task).layout)


def seed_blocks(fits: Iterable[Fit]) -> list[list[Fit]]:
    """Returns the fits in groups that train together.

    The fits of a group differ in their seeds only. A method that does not train seeds together has
    one group for each seed, so that no seed affects another.
    """
    blocks: dict[str, list[Fit]] = {}
    for fit in fits:
        together = fits_together(get_method(fit.method, fit.variant))
        blocks.setdefault((replace(fit, seed=0) if together else fit).key, []).append(fit)
    return list(blocks.values())


@dataclass(frozen=True)
class Evaluation:
    """The conditions of an evaluation.

    Raises:
        InputError: there is no such split, physics or success rule.
    """

    task: str
    split: str
    physics: str = NOMINAL
    controller: str = ORIGINAL
    """Kind of the controller that tracks a predicted motion; ``none`` if no controller is used."""
    controller_key: str = ""
    rule: str = APPENDIX
    """The rule that decides on success."""
    disturbance: str = UNDISTURBED
    """What else goes wrong, see `tasks.disturbances`."""
    replan: int = 0
    """A motion is predicted anew every so many control steps; 0: never."""

    def __post_init__(self) -> None:
        if self.split not in EVALUATION_SPLITS:
            raise unknown_name("split", self.split, EVALUATION_SPLITS)
        task = get_task(self.task, self.rule)
        if self.physics not in task.physics:
            raise unknown_name("physics", self.physics, task.physics)
        if self.replan < 0:
            raise InputError(f"replan must be 0 or more control steps, got {self.replan}")
        find_disturbances(self.disturbance, task)

    @property
    def name(self) -> str:
        """The name of its file, without extension."""
        return evaluation_name(asdict(self))

    def key(self, fit: Fit) -> str:
        """Identifies the results of a fit in these conditions."""
        task = get_task(self.task, self.rule)
        rules = [task.version, task.model_hash, task.steps, CHUNK]
        # The key of the expert's demonstrations includes the version of MuJoCo; a file's does not.
        if not fit.of_expert:
            rules.append(mujoco.__version__)
        if self.disturbance != UNDISTURBED:
            rules.append(f"disturbances {DISTURBANCES}")
        changed = {k: v for k, v in asdict(self).items() if k not in ADDED or v != PLAIN[k]}
        return key("evaluation", fit.key, changed, rules)


@dataclass(frozen=True)
class ControllerSpec:
    """A tracking controller with every value that affects what it learns.

    Raises:
        InputError: there is no such kind, or controllers of that kind do not learn in that physics,
            or start from other weights.
    """

    task: str
    kind: str
    """Says what it learns from, see `bench.controller_kinds`."""
    config: ControllerConfig
    demos: int
    """How many demonstrations it learns from, or how many rollouts of the expert."""
    demos_key: str
    """Key of the demonstrations; of the suite's own if the controller learns from new rollouts of
    the expert."""
    seed: int
    """Of the study: decides the demonstrations or rollouts, and the random numbers."""
    physics: str = NOMINAL
    """Physics in which the rollouts that it learns from are recorded."""
    pins: str = field(default_factory=mark)
    """Whether the kernels that compute it are pinned, see `tasks.pins`."""
    start: "ControllerSpec | None" = None
    """The controller whose weights training starts from. Default: random weights."""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise unknown_name("kind of controller", self.kind, KINDS)
        if KINDS[self.kind].changed_physics == (self.physics == NOMINAL):
            place = "changed" if KINDS[self.kind].changed_physics else NOMINAL
            raise InputError(
                f"a controller of the kind {self.kind} learns in {place} physics, got"
                f" {self.physics!r}"
            )
        start = self.start.kind if self.start else ""
        if start != KINDS[self.kind].starts_from:
            raise InputError(
                f"a controller of the kind {self.kind} starts from"
                f" {KINDS[self.kind].starts_from or 'random'} weights, got {start or 'random'}"
            )

    @cached_property
    def key(self) -> str:
        """Identifies the controller."""
        values = asdict(self) | {"config": self.config.resolved()}
        del values["start"]
        return key("controller", values | ({"start": self.start.key} if self.start else {}))

    @property
    def label(self) -> str:
        """A readable name, for folders and messages."""
        return controller_label(vars(self))


MOST_TOGETHER = 12
"""A controller then trains in half the time of one of three, and the demonstrations of all are held
in memory."""


def controller_blocks(specs: Iterable[ControllerSpec]) -> list[list[ControllerSpec]]:
    """Returns the controllers in groups of at most `MOST_TOGETHER`, which train together.

    Those of a group differ only in their seeds and in the physics of the rollouts they learn from.
    """
    blocks: dict[tuple[Any, ...], list[ControllerSpec]] = {}
    for spec in specs:
        place = (spec.task, spec.kind, spec.config, spec.demos, spec.demos_key, spec.pins)
        blocks.setdefault(place, []).append(spec)
    return [
        block[first : first + MOST_TOGETHER]
        for block in blocks.values()
        for first in range(0, len(block), MOST_TOGETHER)
    ]


@dataclass(frozen=True)
class Cell:
    """A fit, an evaluation of it, and the number of episodes."""

    fit: Fit
    evaluation: Evaluation
    episodes: int
    controller: ControllerSpec | None = None

    @property
    def controllers(self) -> list[ControllerSpec]:
        """The controller, if one is used, and the one that it starts from."""
        return [spec for spec in (self.controller, self._start) if spec]

    @property
    def _start(self) -> ControllerSpec | None:
        return self.controller.start if self.controller else None

    @cached_property
    def wanted(self) -> Wanted:
        """The cell as results folders know it."""
        fit, controller, start = self.fit, self.controller, self._start
        return Wanted(
            Name(fit.label, fit.key),
            Name(self.evaluation.name, self.evaluation.key(fit)),
            self.episodes,
            Name(controller.label, controller.key) if controller else None,
            fit.method != EXPERT,
            Name(start.label, start.key) if start else None,
            fit.pins,
        )
