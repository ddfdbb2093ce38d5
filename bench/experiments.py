"""The paper's experiments, each as a list of cells. Experiments share cells freely."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, fields, replace
from itertools import product
from typing import Any

from bench.presets import SMALLEST, Study
from bench.spec import (
    EXPERT,
    NO_CONTROLLER,
    VALIDATION,
    Cell,
    ControllerSpec,
    Evaluation,
    Fit,
)
from methods.base import ActionMethod, Method
from methods.registry import get_method
from tasks.errors import InputError, unknown_name


def sizes(study: Study, recipes: Mapping[str, str]) -> list[Cell]:
    """Success from the starts of the validation demonstrations, for each size (Tables 1-5)."""
    fits = [
        fit
        for task, name in product(study.tasks, study.methods)
        for size in _sizes(study, get_method(name))
        for fit in _fits(study, task, name, size, recipes)
    ]
    return [_cell(study, fit, VALIDATION, study.episodes["sizes"]) for fit in fits]


def success(study: Study, recipes: Mapping[str, str]) -> list[Cell]:
    """Success from unseen starts, of the expert too."""
    return _on_split(study, recipes, "test", study.episodes["success"])


EXPERIMENTS: dict[str, Callable[[Study, Mapping[str, str]], list[Cell]]] = {
    "sizes": sizes,
    "success": success,
}


def cells_of(study: Study, recipes: Mapping[str, str]) -> list[Cell]:
    """Returns the cells of all experiments that the study names, each once.

    Args:
        study: what is asked for.
        recipes: by task, the key of what its demonstrations are made from.

    Raises:
        InputError: the study names an experiment, size, variant or field that does not exist, or a
            value that a method refuses.
    """
    for name in study.episodes:
        if name not in EXPERIMENTS:
            raise unknown_name("experiment", name, EXPERIMENTS)
    _check_names(study)
    _check_settings(study)
    found: dict[tuple[str, str], Cell] = {}
    for name in study.episodes:
        for cell in EXPERIMENTS[name](study, recipes):
            place = (cell.fit.key, cell.evaluation.name)
            known = found.get(place, cell)
            found[place] = max(known, cell, key=lambda other: other.episodes)
    for fit in {cell.fit.key: cell.fit for cell in found.values()}.values():
        if fit.method != EXPERT:
            fit.build()
    return list(found.values())


def _on_split(study: Study, recipes: Mapping[str, str], split: str, episodes: int) -> list[Cell]:
    fits = []
    for task in study.tasks:
        fits.append(Fit(task, EXPERT, "described", "single", {}, 0, 0, recipes[task]))
        for name in study.methods:
            fits += _fits(study, task, name, _size(study, get_method(name), task), recipes)
    return [_cell(study, fit, split, episodes) for fit in fits]


def _sizes(study: Study, method: type[Method]) -> list[str]:
    """The sizes of a method that the study compares."""
    known = list(method.sizes)
    if study.sizes is None:
        return known
    chosen = [known[0] if size == SMALLEST else size for size in study.sizes]
    return [size for size in known if size in chosen]


def _size(study: Study, method: type[Method], task: str) -> str:
    """The size of a method in all other experiments."""
    compared = _sizes(study, method)
    default = method.default_size.get(task, compared[0])
    return default if default in compared else compared[0]


def _fits(
    study: Study, task: str, name: str, size: str, recipes: Mapping[str, str]
) -> Iterable[Fit]:
    method = get_method(name)
    seeds = study.seeds[:1] if method.deterministic else study.seeds
    for variant in study.variants:
        if variant in method.variants:
            config = asdict(_config(study, get_method(name, variant), size, variant))
            for seed in seeds:
                seed = 0 if method.deterministic else seed
                yield Fit(task, name, variant, size, config, study.demos, seed, recipes[task])


def _config(study: Study, method: type[Method], size: str, variant: str) -> Any:
    config = replace(method.sizes[size], **method.variants[variant])
    names = {field.name for field in fields(config)}
    if "epochs" in names:
        config = replace(config, epochs=max(1, round(config.epochs * study.epochs_share)))
    chosen = {field: v for (name, field), v in study.settings.items() if name == method.name}
    return replace(config, **chosen)


def _check_names(study: Study) -> None:
    methods = [get_method(name) for name in study.methods]
    sizes = dict.fromkeys([SMALLEST, *(size for method in methods for size in method.sizes)])
    variants = dict.fromkeys(variant for method in methods for variant in method.variants)
    asked = (("size", study.sizes or (), sizes), ("variant", study.variants, variants))
    for kind, names, known in asked:
        for name in names:
            if name not in known:
                raise unknown_name(kind, name, known)


def _check_settings(study: Study) -> None:
    for name, field in study.settings:
        if name not in study.methods:
            raise InputError(f"a setting for {name!r}, which is not among the methods of the run")
        config = next(iter(get_method(name).sizes.values()))
        known = [other.name for other in fields(config)]
        if field not in known:
            raise unknown_name(f"config field of {name}", field, known)


def _cell(study: Study, fit: Fit, split: str, episodes: int) -> Cell:
    if fit.method == EXPERT or issubclass(get_method(fit.method), ActionMethod):
        return Cell(fit, Evaluation(fit.task, split, controller=NO_CONTROLLER), episodes)
    controller = ControllerSpec(fit.task, study.controller, study.demos, fit.recipe)
    evaluation = Evaluation(fit.task, split, controller_key=controller.key)
    return Cell(fit, evaluation, episodes, controller)
