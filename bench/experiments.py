"""The paper's experiments, each as a list of cells. Experiments share cells freely."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from itertools import product
from pathlib import Path
from typing import Any, get_type_hints

import pandas as pd

from bench.controller import NO_CONTROLLER, ORIGINAL_SEED, RESEEDED
from bench.labels import as_text
from bench.presets import PRESETS, SMALLEST, Study
from bench.selection import best_size
from bench.settings import fits_type, typed, wrong_type
from bench.spec import EXPERT, VALIDATION, Cell, ControllerSpec, Evaluation, Fit
from methods.base import ActionMethod, Method
from methods.contract import resolved
from methods.kodex import LIFTING_VARIANTS
from methods.registry import SUITE, get_method
from tasks.demos import adopt_demos, demos_key, load_demos, split
from tasks.demos_files import task_of
from tasks.errors import InputError, described, unknown_name
from tasks.masses import NOMINAL, PHYSICS, READINGS, VARIATIONS
from tasks.registry import APPENDIX, JUDGED_OTHERWISE, PUBLISHED, get_task

Recipes = Mapping[str, str]
"""By task, the key of what its demonstrations are made from."""
Sizes = Mapping[tuple[str, str], str]
"""By task and method, the size that did best."""

EFFICIENCY_DEMOS = (10, 25, 50, 100, 150, 200)
ROBUSTNESS = "robustness"


def recipes_of(study: Study) -> Recipes:
    """Returns the keys of the demonstrations that a study learns from."""
    return {task: study.recipes.get(task) or demos_key(get_task(task)) for task in study.tasks}


def learning_from(study: Study, files: Sequence[Path]) -> Study:
    """Returns the study with the demonstrations of files in place of the expert's.

    Args:
        study: what is changed.
        files: one for each task of the study.

    Raises:
        InputError: a task has no file, or two; a file is of another task, or is refused, see
            `adopt_demos`.
    """
    chosen = _by_task(study, files)
    recipes = {task: adopt_demos(get_task(task), file) for task, file in chosen.items()}
    counts = [len(split(load_demos(get_task(task), recipe))[0]) for task, recipe in recipes.items()]
    notes = [
        f"On {task}, the methods and the original controller learnt from the demonstrations of"
        f" {file.name}. The expert in the tables is the suite's own, not the demonstrator of that"
        " file; tuned and unclipped controllers learnt from the suite's expert."
        for task, file in chosen.items()
    ]
    return replace(
        study,
        recipes=recipes,
        demos=min(study.demos, *counts),
        note=" ".join([study.note, *notes]).strip(),
    )


def _by_task(study: Study, files: Sequence[Path]) -> dict[str, Path]:
    """The files by task, in the study's order."""
    tasks, found = ", ".join(study.tasks), dict[str, Path]()
    for file in files:
        name = task_of(file)
        if not name and len(study.tasks) > 1:
            raise InputError(
                f"--demos {file} does not say which task it shows: choose that task with --tasks"
            )
        name = name or study.tasks[0]
        if name not in study.tasks:
            raise InputError(
                f"--demos {file} holds demonstrations of {name}, which is not among the tasks of"
                f" the run ({tasks}): change --tasks"
            )
        if name in found:
            raise InputError(f"--demos {found[name]} and {file} both show {name}: give one of them")
        found[name] = file
    missing = [task for task in study.tasks if task not in found]
    if missing:
        raise InputError(
            f"--demos gives demonstrations of {', '.join(found) or 'no task'}, not of"
            f" {', '.join(missing)}: give a file for each task of the run, or choose tasks with"
            " --tasks"
        )
    return {task: found[task] for task in study.tasks}


def sizes(study: Study, recipes: Recipes, chosen: Sizes) -> list[Cell]:
    """Success from the starts of the validation demonstrations, for each size (Tables 1-5)."""
    fits = [
        fit
        for task, name in product(study.tasks, study.methods)
        for size in _sizes(study, get_method(name))
        for fit in _fits(study, task, name, size, recipes)
    ]
    return [_cell(study, fit, VALIDATION, study.episodes["sizes"]) for fit in fits]


def success(study: Study, recipes: Recipes, chosen: Sizes) -> list[Cell]:
    """Success from unseen starts, of the expert too."""
    fits = _chosen_fits(study, recipes, chosen)
    return [_cell(study, fit, "test", study.episodes["success"]) for fit in fits]


def ood(study: Study, recipes: Recipes, chosen: Sizes) -> list[Cell]:
    """Success from starts out of distribution, of the expert too (Fig. 5)."""
    fits = _chosen_fits(study, recipes, chosen)
    return [_cell(study, fit, "ood", study.episodes["ood"]) for fit in fits]


def robustness(study: Study, recipes: Recipes, chosen: Sizes) -> list[Cell]:
    """Success in changed physics, with the original and the expert-tuned controller (I)."""
    episodes = study.episodes[ROBUSTNESS]
    return [
        _cell(study, fit, "test", episodes, physics, tuned)
        for fit in _chosen_fits(study, recipes, chosen)
        for physics in PHYSICS
        for tuned in ((False,) if physics == NOMINAL or _acts(fit) else (False, True))
    ]


def lifting(study: Study, recipes: Recipes, chosen: Sizes) -> list[Cell]:
    """Success of KODex with each set of observables (Table 11, Fig. 6)."""
    if "kodex" not in study.methods:
        return []
    fits = [
        fit
        for task in study.tasks
        for fit in _fits(study, task, "kodex", "single", recipes, LIFTING_VARIANTS)
    ]
    return [_cell(study, fit, "test", study.episodes["lifting"]) for fit in fits]


def stability(study: Study, recipes: Recipes, chosen: Sizes) -> list[Cell]:
    """The fits whose eigenvalues are looked at (Table 12, Fig. 7): KODex on all demonstrations."""
    if "kodex" not in study.methods:
        return []
    fits = [fit for task in study.tasks for fit in _fits(study, task, "kodex", "single", recipes)]
    return [_cell(study, fit, VALIDATION, study.episodes["stability"]) for fit in fits]


def efficiency(study: Study, recipes: Recipes, chosen: Sizes) -> list[Cell]:
    """Success against the number of demonstrations."""
    counts = [count for count in EFFICIENCY_DEMOS if count <= study.demos]
    fits = [
        fit
        for count in counts
        for fit in _chosen_fits(study, recipes, chosen, count)
        if fit.method != EXPERT
    ]
    return [_cell(study, fit, "test", study.episodes["efficiency"]) for fit in fits]


def audit(study: Study, recipes: Recipes, chosen: Sizes) -> list[Cell]:
    """Success of every variant of every method, and of each method in other readings of the paper.

    Variants are as described, as published, and others. Read otherwise are the masses of appendix
    I, what the controllers learn from, and when an episode succeeds. Controllers with other random
    numbers show what the luck of the original one decides.
    """
    fits = [
        fit
        for task, name in product(study.tasks, study.methods)
        for fit in _fits(
            study,
            task,
            name,
            _size(study, get_method(name), task, chosen),
            recipes,
            _audited(study, get_method(name)),
        )
    ]
    episodes = study.episodes["audit"]
    few = min(episodes, study.episodes.get(ROBUSTNESS, episodes))
    cells = [_cell(study, fit, "test", episodes) for fit in fits]
    for fit in _chosen_fits(study, recipes, chosen):
        cells += [_cell(study, fit, "test", few, physics) for physics in READINGS[fit.task]]
        if fit.task in JUDGED_OTHERWISE:
            cells.append(_cell(study, fit, "test", episodes, rule=PUBLISHED))
        if not _acts(fit):
            cells.append(_cell(study, fit, "test", episodes, raw=True))
            cells += [
                _cell(study, fit, "test", few, physics, tuned=True, failures=False)
                for physics in VARIATIONS
            ]
            cells += [_cell(study, fit, "test", few, controller_seed=seed) for seed in RESEEDED]
    return cells


EXPERIMENTS: dict[str, Callable[[Study, Recipes, Sizes], list[Cell]]] = {
    "sizes": sizes,
    "success": success,
    "ood": ood,
    "robustness": robustness,
    "lifting": lifting,
    "stability": stability,
    "efficiency": efficiency,
    "audit": audit,
}


def first_wave(study: Study, recipes: Recipes) -> list[Cell]:
    """Returns the cells whose results decide the sizes of the rest, if any are compared."""
    return sizes(study, recipes, {}) if "sizes" in study.episodes else []


def chosen_sizes(study: Study, frame: pd.DataFrame) -> dict[tuple[str, str], str]:
    """Returns by task and method the size that does best on validation starts, see `best_size`.

    Args:
        study: whose tasks and methods are asked about.
        frame: stored evaluations, as `bench.store.Store.frame` gives them.
    """
    if frame.empty:
        return {}
    compared = frame[
        (frame.split == VALIDATION)
        & (frame.variant == "described")
        & (frame.demos == study.demos)
        & frame.seed.isin([0, *study.seeds])
    ]
    chosen = {}
    for (task, name), part in compared.groupby(["task", "method"]):
        if task in study.tasks and name in study.methods:
            known = _sizes(study, get_method(name))
            if part["size"].isin(known).any():
                chosen[task, name] = best_size(part, known)
    return chosen


def cells_of(study: Study, recipes: Recipes, chosen: Sizes | None = None) -> list[Cell]:
    """Returns the cells of all experiments that the study names, each once.

    Args:
        study: what is asked for.
        recipes: by task, the key of what its demonstrations are made from.
        chosen: by task and method, the size of all experiments but `sizes`; the methods' default
            sizes unless told.

    Raises:
        InputError: the study names an experiment, size, variant or field that does not exist, a
            value that a method refuses, or variants without the experiment that compares them.
    """
    for name in study.episodes:
        if name not in EXPERIMENTS:
            raise unknown_name("experiment", name, EXPERIMENTS)
    try:
        return _cells_of(study, recipes, chosen or {})
    except InputError:
        raise
    except Exception as error:  # a method of a package may refuse a setting in its own words
        raise InputError(f"a method cannot be set up so: {described(error)}") from error


def _cells_of(study: Study, recipes: Recipes, chosen: Sizes) -> list[Cell]:
    _check_names(study)
    _check_settings(study)
    found: dict[tuple[str, str], Cell] = {}
    for name in study.episodes:
        for cell in EXPERIMENTS[name](study, recipes, chosen):
            place = (cell.fit.key, cell.evaluation.name)
            known = found.get(place, cell)
            found[place] = max(known, cell, key=lambda other: other.episodes)
    for fit in {cell.fit.key: cell.fit for cell in found.values()}.values():
        if fit.method != EXPERT:
            fit.build()
    return list(found.values())


def _chosen_fits(
    study: Study, recipes: Recipes, chosen: Sizes, demos: int | None = None
) -> list[Fit]:
    """The expert, if the study evaluates it, and each method at its size, for each task."""
    fits = []
    for task in study.tasks:
        if study.expert:
            own = demos_key(get_task(task))
            fits.append(Fit(task, EXPERT, "described", "single", {}, 0, 0, own))
        for name in study.methods:
            size = _size(study, get_method(name), task, chosen)
            fits += _fits(study, task, name, size, recipes, demos=demos)
    return fits


def _sizes(study: Study, method: type[Method]) -> list[str]:
    """The sizes of a method that the study compares; all of a method that has none of them."""
    known = list(method.sizes)
    chosen = [known[0] if size == SMALLEST else size for size in study.sizes or ()]
    return [size for size in known if size in chosen] or known


def _size(study: Study, method: type[Method], task: str, chosen: Sizes) -> str:
    """The size of a method in all other experiments."""
    if (task, method.name) in chosen:
        return chosen[task, method.name]
    compared = _sizes(study, method)
    default = method.default_size.get(task, compared[0])
    return default if default in compared else compared[0]


def _audited(study: Study, method: type[Method]) -> list[str]:
    """The variants that `audit` compares; sets of observables have an experiment of their own."""
    if study.variants is not None:
        return [variant for variant in method.variants if variant in study.variants]
    return [variant for variant in method.variants if variant not in LIFTING_VARIANTS[1:]]


def _fits(
    study: Study,
    task: str,
    name: str,
    size: str,
    recipes: Recipes,
    variants: Sequence[str] = ("described",),
    demos: int | None = None,
) -> Iterator[Fit]:
    """One fit for each variant and seed."""
    for variant in variants:
        method = get_method(name, variant)
        if variant in method.variants:
            plain = resolved(_config(study, method, size, variant))
            config = resolved(_with_settings(study, method, size, variant))
            changed = {name: value for name, value in config.items() if value != plain.get(name)}
            for seed in (0,) if method.deterministic else study.seeds:
                count = study.demos if demos is None else demos
                settings = as_text(changed)
                yield Fit(task, name, variant, size, config, count, seed, recipes[task], settings)


def every_fit(study: Study, name: str) -> list[Fit]:
    """Returns fits of a method at every size and in every variant, for the tasks of a study."""
    method = get_method(name)
    return [
        fit
        for task in study.tasks
        for size in (_size(study, method, task, {}), *method.sizes)
        for fit in _fits(study, task, name, size, recipes_of(study), list(method.variants))
    ]


def _config(study: Study, method: type[Method], size: str, variant: str) -> Any:
    config = replace(method.sizes[size], **method.variants[variant])
    names = {field.name for field in fields(config)}
    if "epochs" in names:
        config = replace(config, epochs=max(1, round(config.epochs * study.epochs_share)))
    return config


def _with_settings(study: Study, method: type[Method], size: str, variant: str) -> Any:
    config = _config(study, method, size, variant)
    chosen = {
        field: typed(value, get_type_hints(type(config))[field])
        for (name, field), value in study.settings.items()
        if name == method.name
    }
    return replace(config, **chosen)


def _check_names(study: Study) -> None:
    methods = [get_method(name) for name in study.methods]
    known = dict.fromkeys([SMALLEST, *(size for method in methods for size in method.sizes)])
    variants = dict.fromkeys(variant for method in methods for variant in method.variants)
    asked = (("size", study.sizes, known), ("variant", study.variants, variants))
    for kind, names, allowed in asked:
        for name in names or ():
            if name not in allowed:
                raise _unknown_label(study, kind, name, allowed)
    if study.variants is not None and "audit" not in study.episodes:
        presets = [name for name, preset in PRESETS.items() if "audit" in preset.episodes]
        raise InputError(
            "variants are compared by the experiment audit, which is not among the experiments of"
            f" the run ({', '.join(study.episodes)}); presets with audit: {', '.join(presets)}"
        )


def _unknown_label(study: Study, kind: str, name: str, allowed: Iterable[str]) -> InputError:
    """The error for a size or variant that no method of the run has."""
    others = [other for other in SUITE if name in getattr(get_method(other), f"{kind}s")]
    if not others:
        return unknown_name(kind, name, allowed)
    return InputError(
        f"no method of the run ({', '.join(study.methods)}) has the {kind} {name!r}; methods that"
        f" have it: {', '.join(others)}. Choose from {', '.join(allowed)}, or change --methods"
    )


def _check_settings(study: Study) -> None:
    for (name, field), value in study.settings.items():
        if name not in study.methods:
            get_method(name)
            raise InputError(
                f"{name}.{field} is set, but {name} is not among the methods of the run"
                f" ({', '.join(study.methods)}): add it with --methods, or leave the setting out"
            )
        for variant in _variants(study, get_method(name)):
            config = next(iter(get_method(name, variant).sizes.values()))
            known = [other.name for other in fields(config)]
            if field not in known:
                raise unknown_name(f"config field of {name} as {variant}", field, known)
            hint = get_type_hints(type(config))[field]
            if not fits_type(typed(value, hint), hint):
                raise wrong_type(f"{name}.{field}", hint, value, getattr(config, field))
        for experiment, swept in _swept(study, get_method(name)).items():
            if field in swept and experiment in study.episodes:
                raise InputError(
                    f"{name}.{field} is what {experiment} compares: leave that out with"
                    " --experiments, or the setting"
                )


def _variants(study: Study, method: type[Method]) -> list[str]:
    """The variants of a method whose fits may be asked for."""
    audited = _audited(study, method) if "audit" in study.episodes else []
    return list(dict.fromkeys(["described", *audited]))


def _swept(study: Study, method: type[Method]) -> dict[str, set[str]]:
    """By experiment, the config fields that it gives several values to."""
    variants = {"audit": _audited(study, method), "lifting": LIFTING_VARIANTS}
    swept = {
        experiment: {field for name in names for field in method.variants.get(name, ())}
        for experiment, names in variants.items()
    }
    configs = [resolved(method.sizes[size]) for size in _sizes(study, method)]
    first = configs[0]
    differ = {field for config in configs for field in first if config[field] != first[field]}
    return swept | {"sizes": differ}


def _acts(fit: Fit) -> bool:
    """Whether it needs no controller."""
    return fit.method == EXPERT or issubclass(get_method(fit.method), ActionMethod)


def _cell(
    study: Study,
    fit: Fit,
    split: str,
    episodes: int,
    physics: str = NOMINAL,
    tuned: bool = False,
    failures: bool = True,
    raw: bool = False,
    controller_seed: int = ORIGINAL_SEED,
    rule: str = APPENDIX,
) -> Cell:
    if _acts(fit):
        acting = Evaluation(fit.task, split, physics, NO_CONTROLLER, rule=rule)
        return Cell(fit, acting, episodes)
    learnt = physics if tuned else NOMINAL
    recipe = demos_key(get_task(fit.task)) if tuned or raw else fit.recipe
    controller = ControllerSpec(
        fit.task, study.controller, study.demos, recipe, learnt, failures, raw, controller_seed
    )
    evaluation = Evaluation(fit.task, split, physics, controller.name, controller.key, rule)
    return Cell(fit, evaluation, episodes, controller)
