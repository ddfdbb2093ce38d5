"""Which methods of a study can be used, found out before anything is fitted.

A method of a package is imported, described and built in a process of its own first: what goes
wrong there is a failure of this method, and the others go on.
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
    """Returns the methods that packages bring."""
    return [name for name in methods if name not in SUITE]


def admissions(study: Study, methods: Sequence[str]) -> list[Callable[[], Call]]:
    """Returns for each method a call that describes it, or raises why a study cannot have it."""
    return [partial(_call, replace(study, methods=(name,), settings={})) for name in methods]


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
    """Returns the description of a method; imports it, and so is for processes of their own."""
    return describe_method(get_method(name))
