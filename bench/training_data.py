"""The training data of fits and controllers, and the starts of evaluations."""

from functools import cache
from pathlib import Path

from bench.controller_kinds import KINDS
from bench.isolation import apart
from bench.spec import VALIDATION, Cell, ControllerSpec, Fit
from tasks import demos
from tasks.data import Demos, Starts
from tasks.demos import demos_key, demos_path, load_demos, split
from tasks.experts import load_expert
from tasks.pins import pin
from tasks.recorder import record
from tasks.registry import get_task


def training_demos(of: Fit | ControllerSpec) -> Demos:
    """Returns the training demonstrations that a fit or controller learns from.

    The expert's demonstrations are recorded if the cache lacks them.
    """
    return _demos(of)[0][: of.demos]


def validation_demos(of: Fit | ControllerSpec) -> Demos:
    """Returns the validation demonstrations that belong to them, see `training_demos`."""
    return _demos(of)[1]


def _demos(of: Fit | ControllerSpec) -> tuple[Demos, Demos]:
    return _demos_at(demos_path(get_task(of.task), of.demos_key), of.task, of.demos_key)


@cache
def _demos_at(path: Path, task: str, key: str) -> tuple[Demos, Demos]:
    """Demonstrations in the cache. The path is an argument, since the cache folder may change."""
    return split(load_demos(get_task(task), key))


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
        starts = task.sample("demo", spec.demos)
    else:
        starts = training_demos(spec).starts
    return record(
        task,
        starts,
        load_expert(task).policy,
        spec.physics,
        failures=kind.keeps_failures,
        raw=not kind.clips_actions,
    )[1]


def starts_of(cell: Cell) -> Starts:
    """Returns the starts of an evaluation: the first of its split, no more than there are."""
    split_ = cell.evaluation.split
    if split_ == VALIDATION:
        return validation_demos(cell.fit).starts[: cell.episodes]
    return get_task(cell.evaluation.task).sample(split_, cell.episodes)


def wanted_episodes(cell: Cell) -> int:
    """Returns the episodes of a cell, at most one for each start. Records no demonstrations."""
    if cell.evaluation.split != VALIDATION:
        return cell.episodes
    return min(cell.episodes, _validation_count(cell.fit))


def _validation_count(fit: Fit) -> int:
    """The number of validation starts, without recording the expert's demonstrations."""
    if fit.demos_key == demos_key(get_task(fit.task)):
        return demos.VALIDATION
    return len(validation_demos(fit))
