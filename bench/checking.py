"""Check a method as a run meets it: in processes of their own, and stored between two of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bench.admission import describe_guest
from bench.isolation import apart, printed
from methods.base import Method
from methods.checks import NEEDED, Verdict, check, first_answer
from methods.description import stand_in
from methods.registry import SUITE, get_method, method_names, unknown_method
from methods.toy import answer, loaded_toy
from tasks.data import FloatArray
from tasks.errors import InputError

ANOTHER_PROCESS = "survives_another_process"
ASKS = "What is stored and then loaded in another process gives the same answers."
PRINTED = 3
"""Lines that are kept of what a method prints."""


def known(name: str) -> type[Method]:
    """Returns the class of a method; for one of a package, a stand-in that describes it.

    The package is imported in a process of its own, since that may end the process.

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


@dataclass(frozen=True)
class Checked:
    """What came of a check."""

    verdicts: tuple[Verdict, ...]
    printed: tuple[str, ...] = ()
    """The first lines that the method has printed."""
    lines: int = 0
    """How many it has printed."""


def check_apart(name: str) -> Checked:
    """Returns the verdict of each rule on a method, see `methods.checks`, and what it printed.

    Raises:
        InputError: there is no such method, or it cannot be used.
    """
    known(name)
    try:
        found, stored = apart(_tried, name)
    except InputError as error:
        return Checked((Verdict("ends", False, str(error), 0.0),))
    return replace(found, verdicts=(*found.verdicts, _elsewhere(name, found.verdicts, stored)))


def _elsewhere(
    name: str, verdicts: Sequence[Verdict], stored: tuple[bytes, FloatArray] | None
) -> Verdict:
    """Whether a method answers in another process as it has answered in its own."""
    broken = {verdict.rule: verdict for verdict in verdicts if not verdict.passed}
    needed = [broken[rule] for rule in (*NEEDED, "same_start_same_answer") if rule in broken]
    if stored is None or needed:
        root = next(verdict for verdict in (*needed, *broken.values()) if verdict.tried)
        return Verdict(ANOTHER_PROCESS, False, f"needs {root.rule}", 0.0, tried=False)
    parameters, given = stored
    try:
        again = apart(_answer, name, parameters)
    except InputError as error:
        return Verdict(ANOTHER_PROCESS, False, str(error), 0.0)
    same = np.array_equal(again, given, equal_nan=True)
    message = "" if same else "it answers differently once loaded in another process"
    return Verdict(ANOTHER_PROCESS, same, message, 0.0)


def _tried(name: str) -> tuple[Checked, tuple[bytes, FloatArray] | None]:
    """The verdicts in this process, and what is stored of a fit, with its answer, if there is."""
    method = get_method(name)
    verdicts = tuple(check(method))
    sound = {verdict.rule for verdict in verdicts if verdict.passed}
    stored = first_answer(method) if {*NEEDED} <= sound else None
    return Checked(verdicts, *printed(PRINTED)), stored


def _answer(name: str, parameters: bytes) -> FloatArray:
    return answer(loaded_toy(get_method(name), parameters))
