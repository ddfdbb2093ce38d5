"""What is fitted and how it is evaluated, and the keys by which results are found again.

A key hashes resolved values alone: never an order, a path, a time, or a number of episodes, since
more episodes extend the same evaluation.
"""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import mujoco

from bench.controller import (
    ON_SUCCESSES,
    ORIGINAL,
    ORIGINAL_SEED,
    RESEEDED,
    TUNED,
    UNCLIPPED,
    ControllerConfig,
)
from bench.labels import EXPERT as EXPERT
from bench.labels import RECIPE_DIGITS
from bench.manifest import Name, Wanted
from bench.names import evaluation_name
from methods.base import Method, fits_together
from methods.contract import build
from methods.registry import get_method
from tasks.base import SPLITS
from tasks.data import key
from tasks.demos import demos_key
from tasks.errors import unknown_name
from tasks.masses import NOMINAL, physics_names
from tasks.registry import APPENDIX, get_task
from tasks.simulator import CHUNK

VALIDATION = "validation"
"""The starts of the validation demonstrations, as a split."""
EVALUATION_SPLITS = (VALIDATION, *(split for split in SPLITS if split not in ("train", "demo")))


@dataclass(frozen=True)
class Fit:
    """A method with all that decides what it learns."""

    task: str
    method: str
    variant: str
    size: str
    config: Mapping[str, Any]
    """Every field of the method's config."""
    demos: int
    """N, the first so many training demonstrations."""
    seed: int
    recipe: str
    """Key of what the demonstrations are made from."""
    settings: str = ""
    """What `--set` has changed of the config, such as ``hidden=64``, see `bench.labels`."""

    @cached_property
    def key(self) -> str:
        """Names the fit; the config has a part in it, and neither its size nor what was set."""
        version = 0 if self.method == EXPERT else get_method(self.method, self.variant).version
        values = {k: value for k, value in asdict(self).items() if k not in ("size", "settings")}
        return key("fit", version, values)

    @property
    def label(self) -> str:
        """A name for people to read, of a folder or in a message, of what a study asks for.

        Of fits under one label a study shows the last that was asked for.
        """
        if self.method == EXPERT:
            return f"{self.task}-{self.method}"
        own = self.recipe == demos_key(get_task(self.task))
        origin = "" if own else self.recipe[:RECIPE_DIGITS]
        parts = [self.task, self.method, self.settings, self.variant, self.size]
        parts += [f"n{self.demos}", origin, f"s{self.seed}"]
        return "-".join(part for part in parts if part)

    def build(self) -> Method:
        """Returns the method, not fitted.

        Raises:
            InputError: the method refuses the config.
        """
        method = get_method(self.method, self.variant)
        return build(method, self.config, get_task(self.task).layout)


def seed_blocks(fits: Iterable[Fit]) -> list[list[Fit]]:
    """Returns the fits in groups that are fitted together.

    A group differs in its seeds alone. A method that does not train seeds together has a group for
    each, so that no seed depends on what another has left behind.
    """
    blocks: dict[str, list[Fit]] = {}
    for fit in fits:
        together = fits_together(get_method(fit.method, fit.variant))
        blocks.setdefault((replace(fit, seed=0) if together else fit).key, []).append(fit)
    return list(blocks.values())


@dataclass(frozen=True)
class Evaluation:
    """The conditions in which a fit is put to the test.

    Raises:
        InputError: there is no such split, physics or rule.
    """

    task: str
    split: str
    physics: str = NOMINAL
    controller: str = ORIGINAL
    """Name of what tracks a predicted motion; none for what acts by itself."""
    controller_key: str = ""
    rule: str = APPENDIX
    """By which success is judged."""

    def __post_init__(self) -> None:
        if self.split not in EVALUATION_SPLITS:
            raise unknown_name("split", self.split, EVALUATION_SPLITS)
        known = physics_names(self.task)
        if self.physics not in known:
            raise unknown_name("physics", self.physics, known)
        get_task(self.task, self.rule)

    @property
    def name(self) -> str:
        """The name of its file, without ending."""
        return evaluation_name(asdict(self))

    def key(self, fit: Fit) -> str:
        """Names what comes of a fit in these conditions."""
        task = get_task(self.task, self.rule)
        rules = [task.version, task.model_hash, task.steps, CHUNK]
        # The task's own recipe says which MuJoCo there is; one of a file does not.
        if fit.recipe != demos_key(get_task(self.task)):
            rules.append(mujoco.__version__)
        return key("evaluation", fit.key, asdict(self), rules)


@dataclass(frozen=True)
class ControllerSpec:
    """A tracking controller with all that decides what it learns."""

    task: str
    config: ControllerConfig
    demos: int
    recipe: str
    """Key of what its demonstrations are made from; the task's own where it learns from what the
    expert does elsewhere, or raw."""
    physics: str = NOMINAL
    """Where its demonstrations are from; where it is not nominal, the controller is expert-tuned:
    it learns from the expert's first rollouts there (appendix I)."""
    failures: bool = True
    """Whether those rollouts are kept that fail."""
    raw: bool = False
    """Whether it learns the expert's actions as they were given, instead of clipped to [-1, 1]."""
    seed: int = ORIGINAL_SEED
    """Of its random numbers."""

    @cached_property
    def key(self) -> str:
        """Names the controller."""
        learnt = (self.demos, self.recipe, self.physics, self.failures, self.raw)
        # The original's keys are from before there were other seeds, and do not name it.
        seed = () if self.seed == ORIGINAL_SEED else (self.seed,)
        return key("controller", self.task, self.config.resolved(), (*learnt, *seed))

    @property
    def name(self) -> str:
        """What its evaluations call it."""
        if self.physics == NOMINAL:
            if self.raw:
                return UNCLIPPED
            return ORIGINAL if self.seed == ORIGINAL_SEED else RESEEDED[self.seed]
        return TUNED if self.failures else ON_SUCCESSES

    @property
    def label(self) -> str:
        """A name for people to read."""
        return f"{self.task}-{self.name}-{self.physics}"


@dataclass(frozen=True)
class Cell:
    """One fit, one evaluation of it, and how many episodes are asked for."""

    fit: Fit
    evaluation: Evaluation
    episodes: int
    controller: ControllerSpec | None = None

    @cached_property
    def wanted(self) -> Wanted:
        """The cell as results folders know it."""
        fit, controller = self.fit, self.controller
        return Wanted(
            Name(fit.label, fit.key),
            Name(self.evaluation.name, self.evaluation.key(fit)),
            self.episodes,
            Name(controller.label, controller.key) if controller else None,
        )
