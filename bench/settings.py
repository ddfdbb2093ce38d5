"""Checks of the names and the settings (`--set`) of a study."""

from collections.abc import Iterable
from dataclasses import fields
from typing import Any, get_type_hints

from bench.field_types import fits_type, several, wrong_type
from bench.fits import compared_variants
from bench.presets import PRESETS, SMALLEST, Study
from bench.selection import compared_sizes
from methods.base import Method
from methods.contract import resolved
from methods.kodex import LIFTING_VARIANTS
from methods.registry import SUITE, get_method, method_names, unknown_method
from tasks.errors import InputError, unknown_name


def check_names(study: Study) -> None:
    """Raises InputError if the sizes or variants of a study cannot be compared.

    A size or variant is unknown to every method of the study, or there are variants without the
    experiment ``variants``, which compares them.
    """
    methods = [get_method(name) for name in study.methods]
    sizes = dict.fromkeys([SMALLEST, *(size for method in methods for size in method.sizes)])
    variants = dict.fromkeys(variant for method in methods for variant in method.variants)
    for kind, names, known in (
        ("size", study.sizes, sizes),
        ("variant", study.variants, variants),
    ):
        for name in names or ():
            if name not in known:
                raise _unknown_label(study, kind, name, known)
    if study.variants is not None and "variants" not in study.episodes:
        presets = [name for name, preset in PRESETS.items() if "variants" in preset.episodes]
        raise InputError(
            "the experiment variants compares variants, and is not among the experiments of the run"
            f" ({', '.join(study.episodes)}); presets with it: {', '.join(presets)}"
        )


def _unknown_label(study: Study, kind: str, name: str, known: Iterable[str]) -> InputError:
    """The error for a size or variant that no method of the study has."""
    others = [other for other in SUITE if name in getattr(get_method(other), f"{kind}s")]
    if not others:
        return unknown_name(kind, name, known)
    return InputError(
        f"no method of the run ({', '.join(study.methods)}) has the {kind} {name!r}; methods that"
        f" have it: {', '.join(others)}. Choose from {', '.join(known)}, or change --methods"
    )


def check_settings(study: Study) -> None:
    """Raises InputError if a setting of a study cannot be used.

    Its method is not in the study, its field does not exist or has another type, or an experiment
    of the study compares several values of that field.
    """
    for (name, field), value in study.settings.items():
        _check_method(study, name, field)
        for variant in _requested_variants(study, get_method(name)):
            _check_value(name, variant, field, value)
        _check_not_compared(study, name, field)


def _check_method(study: Study, name: str, field: str) -> None:
    if name not in study.methods:
        if name not in method_names():
            raise unknown_method(name)
        raise InputError(
            f"{name}.{field} is set, but {name} is not among the methods of the run"
            f" ({', '.join(study.methods)}): add it with --methods, or leave the setting out"
        )


def _check_value(name: str, variant: str, field: str, value: Any) -> None:
    config = next(iter(get_method(name, variant).sizes.values()))
    known = [other.name for other in fields(config)]
    if field not in known:
        raise unknown_name(f"config field of {name} as {variant}", field, known)
    hint = get_type_hints(type(config))[field]
    values = several(value, hint)
    for one in values:
        if not fits_type(one, hint):
            given = one if len(values) > 1 else value
            raise wrong_type(f"{name}.{field}", hint, given, getattr(config, field))


def _check_not_compared(study: Study, name: str, field: str) -> None:
    for experiment, compared in _compared_fields(study, get_method(name)).items():
        if field in compared and experiment in study.episodes:
            raise InputError(
                f"{name}.{field} is what {experiment} compares: leave out that experiment with"
                " --experiments, or the setting"
            )


def _requested_variants(study: Study, method: type[Method]) -> list[str]:
    """The variants of a method that the study may fit."""
    compared = compared_variants(study, method) if "variants" in study.episodes else []
    return list(dict.fromkeys(["described", *compared]))


def _compared_fields(study: Study, method: type[Method]) -> dict[str, set[str]]:
    """By experiment, the config fields of a method whose values it compares."""
    variants = {"variants": compared_variants(study, method), "lifting": LIFTING_VARIANTS}
    compared = {
        experiment: {field for name in names for field in method.variants.get(name, ())}
        for experiment, names in variants.items()
    }
    configs = [resolved(method.sizes[size]) for size in compared_sizes(study, method)]
    first = configs[0]
    differ = {field for config in configs for field in first if config[field] != first[field]}
    return compared | {"sizes": differ}
