"""Which methods of a study can be used, found out before anything is fitted.

A method of a package is imported, described and built in a process of its own first: what goes
wrong there is a failure of this method, and the others go on.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from bench.backend import Call
from bench.experiments import every_fit
from bench.presets import Study
from methods.contract import resolved
from methods.registry import SUITE, get_method


def guests(methods: Sequence[str]) -> list[str]:
    """Returns the methods that packages bring."""
    return [name for name in methods if name not in SUITE]


def admissions(study: Study, methods: Sequence[str]) -> list[Callable[[], Call]]:
    """Returns for each method a call that raises, if it cannot be used in a study, why."""
    return [partial(_call, replace(study, methods=(name,), settings={})) for name in methods]


def _call(study: Study) -> Call:
    return study.methods[0], _admit, (study,)


def _admit(study: Study) -> None:
    (name,) = study.methods
    for variant in get_method(name).variants:
        for config in get_method(name, variant).sizes.values():
            resolved(config)
    for fit in every_fit(study, name):
        fit.build()
        assert fit.key
