"""Cells: fits evaluated in given conditions, each with the controller that it needs."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from bench.controller_kinds import KINDS, NO_CONTROLLER, ORIGINAL
from bench.presets import Study
from bench.spec import EXPERT, Cell, ControllerSpec, Evaluation, Fit
from methods.base import ActionMethod
from methods.registry import get_method
from tasks.demos import demos_key
from tasks.disturbances import UNDISTURBED
from tasks.errors import InputError
from tasks.experts import experts_of
from tasks.masses import NOMINAL
from tasks.registry import APPENDIX, get_task


@dataclass(frozen=True)
class Conditions:
    """The conditions of an evaluation, the same for every fit."""

    split: str
    physics: str = NOMINAL
    controller: str = ORIGINAL
    """Kind of the controller of a fit that needs one."""
    rule: str = APPENDIX
    """The rule that decides on success."""
    disturbance: str = UNDISTURBED
    replan: int = 0
    """Of a method that replans: a new motion every so many control steps. 0: never."""


def cells(
    study: Study, fits: Sequence[Fit], conditions: Iterable[Conditions], episodes: int
) -> list[Cell]:
    """Returns a cell for each fit in each of the conditions that its task has."""
    return [
        _cell(study, fit, place, episodes)
        for place in conditions
        for fit in fits
        if place.physics in get_task(fit.task).physics
    ]


def tracked(fits: Iterable[Fit]) -> list[Fit]:
    """Returns the fits that predict motions, which a controller tracks."""
    return [fit for fit in fits if _is_tracked(fit)]


def _is_tracked(fit: Fit) -> bool:
    return fit.method != EXPERT and not issubclass(get_method(fit.method), ActionMethod)


def _cell(study: Study, fit: Fit, place: Conditions, episodes: int) -> Cell:
    controller = _controller(study, fit, place) if _is_tracked(fit) else None
    evaluation = Evaluation(
        fit.task,
        place.split,
        place.physics,
        controller.kind if controller else NO_CONTROLLER,
        controller.key if controller else "",
        place.rule,
        place.disturbance,
        place.replan,
    )
    return Cell(fit, evaluation, episodes, controller)


def _controller(study: Study, fit: Fit, place: Conditions) -> ControllerSpec:
    kind = KINDS[place.controller]
    if kind.records_expert and not experts_of(get_task(fit.task)):
        raise InputError(
            f"a controller of the kind {kind.name} learns from new rollouts of the expert, and task"
            f" {fit.task!r} has none: leave out the experiment with --experiments"
        )
    begin = replace(place, controller=kind.starts_from) if kind.starts_from else None
    return ControllerSpec(
        fit.task,
        kind.name,
        study.controller,
        study.demos,
        demos_key(get_task(fit.task), fit.expert) if kind.records_expert else fit.demos_key,
        fit.seed,
        place.physics if kind.changed_physics else NOMINAL,
        start=_controller(study, fit, begin) if begin else None,
    )
