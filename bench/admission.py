"""Finds out, before anything is fitted, which methods of packages a study can use.

Each is first imported, described and built in its own process. If that fails, the method counts as
failed and the others run.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial

from bench.backend import Call
from bench.fits import every_fit
from bench.presets import Study
from methods.description import Description, describe_method
from methods.registry import SUITE, get_method


def guests(methods: Iterable[str]) -> list[str]:
    """Returns those of the methods that come from packages, not from this suite."""
    return [name for name in methods if name not in SUITE]


def admissions(study: Study, methods: Sequence[str]) -> list[Callable[[], Call]]:
    """Returns for each method a call that describes it and builds every fit of it in a study."""
    return [
        partial(_call, replace(study, methods=(name,), settings={}, weights={})) for name in methods
    ]


def introductions(methods: Sequence[str]) -> list[Callable[[], Call]]:
    """Returns for each method a call that describes it."""
    return [partial(_described, name) for name in methods]


def _call(study: Study) -> Call:
    return study.methods[0], _admit, (study,)


def _described(name: str) -> Call:
    return name, describe_guest, (name,)


def _admit(study: Study) -> Description:
    (name,) = study.methods
    description = describe_guest(name)
    for fit in every_fit(study, name):
        fit.build()
    return description


def describe_guest(name: str) -> Description:
    """Returns the description of a method. Imports it, so call it in a separate process."""
    return describe_method(get_method(name))
