"""The training data of fits and controllers, and the starts of evaluations, all of their seed."""

from functools import lru_cache
from pathlib import Path

from bench.controller_kinds import KINDS
from bench.isolation import apart
from bench.spec import VALIDATION, Cell, ControllerSpec, Fit
from tasks import demos
from tasks.cache import cache_folder
from tasks.data import Demos, Starts
from tasks.demos import demos_of, expert_of
from tasks.experts import load_expert
from tasks.pins import pin
from tasks.recorder import record
from tasks.registry import get_task

KEPT = 16
"""Blocks of demonstrations that stay in memory, some 20 MB each."""


def training_demos(of: Fit | ControllerSpec) -> Demos:
    """Returns the training demonstrations that a fit or controller learns from.

    The expert's demonstrations are recorded if the cache lacks them.
    """
    return _demos(of)[0][: of.demos]


def validation_demos(of: Fit) -> Demos:
    """Returns the validation demonstrations that belong to a fit, see `training_demos`."""
    training, validation = _demos(of)
    return training[of.demos : of.demos + of.held_out] if of.held_out else validation


def _demos(of: Fit | ControllerSpec) -> tuple[Demos, Demos]:
    return _demos_at(cache_folder(), of.task, of.demos_key, of.seed)


@lru_cache(KEPT)
def _demos_at(folder: Path, task: str, key: str, seed: int) -> tuple[Demos, Demos]:
    """Demonstrations in the cache. The folder is an argument, since it may change."""
    return demos_of(get_task(task), key, seed)


def controller_demos(spec: ControllerSpec) -> Demos:
    """Returns the training data of a controller: demonstrations or new rollouts of the expert."""
    kind = KINDS[spec.kind]
    if not kind.records_expert:
        return training_demos(spec)
    found: Demos = apart(_rollouts, spec) if pin().late else _rollouts(spec)
    return found


def _rollouts(spec: ControllerSpec) -> Demos:
    kind, task = KINDS[spec.kind], get_task(spec.task)
    if kind.changed_physics:
        starts = task.sample("demo", spec.demos, spec.seed)
    else:
        starts = training_demos(spec).starts
    return record(
        task,
        starts,
        load_expert(task, expert_of(task, spec.demos_key)).policy,
        spec.physics,
        failures=kind.keeps_failures,
        raw=not kind.clips_actions,
    )[1]


def starts_of(cell: Cell) -> Starts:
    """Returns the starts of an evaluation: the first of its split and seed."""
    split_ = cell.evaluation.split
    if split_ == VALIDATION:
        return validation_demos(cell.fit).starts[: cell.episodes]
    return get_task(cell.evaluation.task).sample(split_, cell.episodes, cell.fit.seed)


def wanted_episodes(cell: Cell) -> int:
    """Returns the episodes of a cell, at most one for each start. Records no demonstrations."""
    if cell.evaluation.split != VALIDATION:
        return cell.episodes
    return min(cell.episodes, _validation_count(cell.fit))


def _validation_count(fit: Fit) -> int:
    """The number of validation starts, without recording the expert's demonstrations."""
    return demos.VALIDATION if fit.of_expert else len(validation_demos(fit))
