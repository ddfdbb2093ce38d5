"""Checks a method as a run uses it: in separate processes, with its parameters stored between."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from bench.admission import describe_guest
from bench.checked import ANOTHER_PROCESS, PRINTED, Checked
from bench.isolation import afresh, apart, printed
from methods.base import Method
from methods.checks import DECLARED, REPEATS, check
from methods.description import stand_in
from methods.registry import SUITE, get_method, method_names, unknown_method
from methods.subject import subjects
from methods.toy import answer
from tasks.data import FloatArray
from tasks.errors import InputError
from tasks.rule_results import RuleResult

ASKS = "Parameters that are stored and loaded in another process give the same answers."
DIFFERS = (
    "it answers differently once loaded in another process: nothing may depend on hash(), id(), the"
    " order of a set, or the process"
)


def known(name: str) -> type[Method]:
    """Returns the class of a method. A method of a package is represented by a stand-in.

    The package is imported in a separate process, since the import may end the process.

    Raises:
        InputError: there is no such method, or it cannot be used.
    """
    return get_method(name) if name in SUITE else _stand_in(name)


@cache
def _stand_in(name: str) -> type[Method]:
    if name not in method_names():
        raise unknown_method(name)
    try:
        return stand_in(apart(describe_guest, name))
    except InputError as error:
        raise InputError(f"method {name!r} cannot be used: {error}") from error


Stored = Mapping[str, tuple[bytes, FloatArray]]
"""By variant, the parameters of a fit and the answer of the method that loads them."""


def check_apart(name: str) -> Checked:
    """Checks every rule on every variant of a method; also returns the start of its output.

    See `methods.checks`.

    Raises:
        InputError: there is no such method, or it cannot be used.
    """
    known(name)
    try:
        found, stored = apart(_tried, name)
    except InputError as error:
        return Checked((RuleResult("ends", None, False, str(error), 0.0),))
    variants = dict.fromkeys(one.variant for one in found.results if one.rule != DECLARED)
    elsewhere = [_elsewhere(name, variant, found.results, stored) for variant in variants]
    return replace(found, results=(*found.results, *elsewhere))


def _elsewhere(
    name: str, variant: str | None, results: Sequence[RuleResult], stored: Stored
) -> RuleResult:
    """The result of the rule that a variant gives the same answer in another process."""
    result = RuleResult(ANOTHER_PROCESS, variant, False, "", 0.0)
    if variant is None or variant not in stored:
        reason = _reason([one for one in results if one.variant in (variant, None)])
        return replace(result, message=reason, tried=False)
    parameters, given = stored[variant]
    try:
        again = afresh(_answer, name, variant, parameters)
    except InputError as error:
        return replace(result, message=str(error))
    if np.array_equal(again, given, equal_nan=True):
        return replace(result, passed=True)
    return replace(result, message=DIFFERS)


def _reason(results: Sequence[RuleResult]) -> str:
    """Names the broken rule that must hold before a variant is loaded elsewhere."""
    broken = {result.rule: result for result in results if not result.passed}
    needed = [broken[rule] for rule in REPEATS if rule in broken]
    root = next(result for result in (*needed, *broken.values()) if result.tried)
    return f"needs {root.rule}"


def _tried(name: str) -> tuple[Checked, Stored]:
    """Checks a method in this process; also returns a stored fit of each variant that passes."""
    method = get_method(name)
    results = tuple(check(method))
    broken = {(result.variant, result.rule) for result in results if not result.passed}
    stored = {}
    if (None, DECLARED) not in broken:
        for subject in subjects(method):
            if not {(subject.variant, rule) for rule in REPEATS} & broken:
                parameters = subject.fit().learnt.parameters
                stored[subject.variant] = parameters, subject.answer()
    return Checked(results, *printed(PRINTED)), stored


def _answer(name: str, variant: str, parameters: bytes) -> FloatArray:
    (subject,) = [one for one in subjects(get_method(name)) if one.variant == variant]
    return answer(subject.load(parameters))
