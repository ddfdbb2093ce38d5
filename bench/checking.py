"""Check a method as a run meets it: in processes of their own, and stored between two of them."""

from functools import cache

import numpy as np

from bench.admission import describe_guest
from bench.isolation import apart
from methods.base import Method
from methods.checks import Verdict, answer, check, learnt_toy, loaded_toy
from methods.description import stand_in
from methods.registry import SUITE, get_method, method_names, unknown_method
from tasks.data import FloatArray
from tasks.errors import InputError

ANOTHER_PROCESS = "survives_another_process"
ASKS = "What is stored and then loaded in another process gives the same answers."


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


def check_apart(name: str) -> list[Verdict]:
    """Returns the verdict of each rule on a method, see `methods.checks`.

    Raises:
        InputError: there is no such method, or it cannot be used.
    """
    known(name)
    try:
        found: list[Verdict] = apart(_rules, name)
    except InputError as error:
        return [Verdict("ends", False, str(error), 0.0)]
    if not all(verdict.tried for verdict in found):
        return [*found, Verdict(ANOTHER_PROCESS, False, "", 0.0, tried=False)]
    message = _changed_by_another_process(name)
    return [*found, Verdict(ANOTHER_PROCESS, not message, message, 0.0)]


def _changed_by_another_process(name: str) -> str:
    try:
        parameters, given = apart(_learnt, name)
        again = apart(_answer, name, parameters)
    except InputError as error:
        return str(error)
    same = np.array_equal(again, given, equal_nan=True)
    return "" if same else "it answers differently once loaded in another process"


def _rules(name: str) -> list[Verdict]:
    return list(check(get_method(name)))


def _learnt(name: str) -> tuple[bytes, FloatArray]:
    (learnt,) = learnt_toy(get_method(name))
    return learnt.parameters, answer(learnt.method)


def _answer(name: str, parameters: bytes) -> FloatArray:
    return answer(loaded_toy(get_method(name), parameters))
