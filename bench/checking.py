"""Check a method as a run meets it: in processes of their own, and stored between two of them."""

import pickle
from typing import Any

import numpy as np

from bench.isolation import Failure, Job, do_apart
from methods.checks import Verdict, answer, check, learnt_toy, loaded_toy
from methods.registry import SUITE, get_method, method_names, unknown_method
from tasks.data import FloatArray
from tasks.errors import InputError

ANOTHER_PROCESS = "survives_another_process"
ASKS = "What is stored and then loaded in another process gives the same answers."
LIMIT = 600.0
"""Seconds for each process."""


def import_apart(name: str) -> None:
    """Imports a method in a process of its own, since the import may end the process.

    Raises:
        InputError: there is no such method, or it cannot be used.
    """
    if name in SUITE:
        return
    found = _apart(_import, name)
    if isinstance(found, Failure):
        raise InputError(f"method {name!r} cannot be used: {found.reason}")


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
    found = _apart(_rules, name)
    if isinstance(found, Failure):
        return [Verdict("ends", False, found.reason, 0.0)]
    if not all(verdict.tried for verdict in found):
        return [*found, Verdict(ANOTHER_PROCESS, False, "", 0.0, tried=False)]
    learnt = _apart(_learnt, name)
    again = learnt if isinstance(learnt, Failure) else _apart(_answer, name, learnt[0])
    if isinstance(again, Failure):
        message = again.reason
    else:
        same = np.array_equal(again, learnt[1], equal_nan=True)
        message = "" if same else "it answers differently once loaded in another process"
    return [*found, Verdict(ANOTHER_PROCESS, not message, message, 0.0)]


def _apart(job: Job, *arguments: Any) -> Any:
    return pickle.loads(do_apart("check", pickle.dumps((job, arguments)), LIMIT))


def _rules(name: str) -> list[Verdict]:
    return list(check(get_method(name)))


def _learnt(name: str) -> tuple[bytes, FloatArray]:
    (learnt,) = learnt_toy(get_method(name))
    return learnt.parameters, answer(learnt.method)


def _answer(name: str, parameters: bytes) -> FloatArray:
    return answer(loaded_toy(get_method(name), parameters))
