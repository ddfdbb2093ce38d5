"""Check a method as a run meets it: in processes of their own, and stored between two of them."""

import numpy as np

from bench.isolation import apart
from methods.checks import Verdict, answer, check, learnt_toy, loaded_toy
from methods.registry import SUITE, get_method, method_names, unknown_method
from tasks.data import FloatArray
from tasks.errors import InputError

ANOTHER_PROCESS = "survives_another_process"
ASKS = "What is stored and then loaded in another process gives the same answers."


def import_apart(name: str) -> None:
    """Imports a method in a process of its own first, since the import may end the process.

    Raises:
        InputError: there is no such method, or it cannot be used.
    """
    if name in SUITE:
        return
    try:
        apart(_import, name)
    except InputError as error:
        raise InputError(f"method {name!r} cannot be used: {error}") from error


def _import(name: str) -> None:
    get_method(name)


def check_apart(name: str) -> list[Verdict]:
    """Returns the verdict of each rule on a method, see `methods.checks`.

    Raises:
        InputError: there is no such method, or it cannot be used.
    """
    if name not in method_names():
        raise unknown_method(name)
    import_apart(name)
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
