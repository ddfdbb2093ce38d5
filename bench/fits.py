"""The fits of a study: each method, at its sizes, in its variants, with its seeds."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from itertools import product
from typing import Any, get_type_hints

from bench.field_types import several
from bench.labels import as_text
from bench.presets import Study
from bench.selection import Sizes, compared_sizes, used_size
from bench.spec import EXPERT, Fit
from bench.study_demos import demos_key_of
from methods.base import Method, config_of, machine_fields
from methods.contract import resolved
from methods.kodex import LIFTING_VARIANTS
from methods.registry import get_method
from tasks.demos import demos_key
from tasks.errors import InputError, described
from tasks.experts import experts_of
from tasks.registry import get_task


def chosen_fits(study: Study, chosen: Sizes) -> list[Fit]:
    """Returns the expert, if study and task have one, and each method at its used size, by task."""
    fits = []
    for task in study.tasks:
        if study.expert and experts_of(get_task(task)):
            own = demos_key(get_task(task), study.taught_by)
            fits += [
                Fit(task, EXPERT, "described", "single", {}, 0, seed, own, expert=study.taught_by)
                for seed in study.seeds
            ]
        for name in study.methods:
            fits += fits_of(study, task, name, used_size(study, get_method(name), task, chosen))
    return fits


def fits_of_sizes(study: Study) -> list[Fit]:
    """Returns the fits of every method at each size that the study compares."""
    return [
        fit
        for task in study.tasks
        for name in study.methods
        for size in compared_sizes(study, get_method(name))
        for fit in fits_of(study, task, name, size)
    ]


def fits_of_variants(study: Study, chosen: Sizes) -> list[Fit]:
    """Returns the fits of every method in each variant that is compared."""
    return [
        fit
        for task in study.tasks
        for name in study.methods
        for method in [get_method(name)]
        for size in [used_size(study, method, task, chosen)]
        for fit in fits_of(study, task, name, size, compared_variants(study, method))
    ]


def fits_of_kodex(study: Study, variants: Sequence[str] = ("described",)) -> list[Fit]:
    """Returns the fits of KODex on each task; none if the study does not have KODex."""
    if "kodex" not in study.methods:
        return []
    return [
        fit for task in study.tasks for fit in fits_of(study, task, "kodex", "single", variants)
    ]


def every_fit(study: Study, name: str) -> list[Fit]:
    """Returns fits of a method at every size and in every variant, for the tasks of a study."""
    method = get_method(name)
    return [
        fit
        for task in study.tasks
        for size in (used_size(study, method, task, {}), *method.sizes)
        for fit in fits_of(study, task, name, size, list(method.variants))
    ]


def held_out(fit: Fit) -> Fit:
    """Returns a fit that has N demonstrations in all.

    A method that chooses by validation holds out a fifth of them.
    """
    if not get_method(fit.method, fit.variant).validates:
        return fit
    count = max(1, fit.demos // 5)
    return replace(fit, demos=fit.demos - count, held_out=count)


def compared_variants(study: Study, method: type[Method]) -> list[str]:
    """Returns the compared variants of a method. Sets of observables are left to ``lifting``."""
    if study.variants is not None:
        return [variant for variant in method.variants if variant in study.variants]
    return [variant for variant in method.variants if variant not in LIFTING_VARIANTS[1:]]


def fits_of(
    study: Study, task: str, name: str, size: str, variants: Sequence[str] = ("described",)
) -> Iterator[Fit]:
    """Yields one fit for each variant that the method has, and each seed."""
    demonstrations, saved = demos_key_of(study, task), study.weights.get((name, task))
    weights = saved.digest if saved else ""
    for variant in variants:
        method = get_method(name, variant)
        if variant not in method.variants:
            continue
        plain = _config(study, method, size, variant)
        before, machine = resolved(plain), machine_fields(plain)
        for config in map(resolved, _with_settings(study, method, plain)):
            decisive = ((field, v) for field, v in config.items() if field not in machine)
            changed = {field: v for field, v in decisive if v != before.get(field)}
            for seed in study.seeds:
                place = (task, name, variant, size, config, study.demos, seed)
                yield Fit(
                    *place,
                    demonstrations,
                    as_text(changed),
                    expert=study.taught_by,
                    weights=weights,
                )


def _config(study: Study, method: type[Method], size: str, variant: str) -> Any:
    """The config of a method, with the study's share of its epochs."""
    config = config_of(method, size, variant)
    if "epochs" in {field.name for field in fields(config)}:
        config = replace(config, epochs=max(1, round(config.epochs * study.epochs_share)))
    return config


def _with_settings(study: Study, method: type[Method], config: Any) -> Iterator[Any]:
    """Yields the config with the fields that the study sets, once for each combination of values.

    Configs that are equal are yielded once.
    """
    hints = get_type_hints(type(config))
    values = {
        field: several(value, hints[field])
        for (name, field), value in study.settings.items()
        if name == method.name
    }
    chosen = (dict(zip(values, found, strict=True)) for found in product(*values.values()))
    with in_its_own_words(method.name):
        configs = dict.fromkeys(replace(config, **changes) for changes in chosen)
    yield from configs


@contextmanager
def in_its_own_words(method: str) -> Iterator[None]:
    """Turns any error with which a method refuses its config into an InputError."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{method} cannot be set up: {described(error)}") from error
