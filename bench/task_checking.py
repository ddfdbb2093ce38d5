"""Checks a task in separate processes."""

import hashlib
from dataclasses import replace

import numpy as np

from bench.checked import ANOTHER_PROCESS, PRINTED, Checked
from bench.guest_tasks import check_free, use_apart
from bench.isolation import afresh, apart, printed
from tasks.checks import FIRST, check
from tasks.errors import InputError
from tasks.observed import seen
from tasks.registry import get_task, task_names, unknown_task
from tasks.rule_results import RuleResult

ASKS = "The same episodes have the same bits in another process."


def check_task_apart(name: str) -> Checked:
    """Checks every rule on a task; also returns the start of its output. See `tasks.checks`.

    Raises:
        InputError: there is no such task, it cannot be used, or its name means something else.
    """
    if name not in task_names():
        raise unknown_task(name)
    check_free(name)
    use_apart(_import, name)
    try:
        found, digest = apart(_tried, name)
    except InputError as error:
        return Checked((RuleResult("ends", None, False, str(error), 0.0),))
    return replace(found, results=(*found.results, _elsewhere(name, digest)))


def _import(name: str) -> None:
    get_task(name)


def _tried(name: str) -> tuple[Checked, str]:
    """Checks a task; also returns the digest of its episodes, empty if there are none."""
    results = tuple(check(type(get_task(name))))
    broken = {result.rule for result in results if not result.passed}
    digest = "" if broken & {*FIRST, "same_start_same_episode"} else _digest(name)
    return Checked(results, *printed(PRINTED)), digest


def _elsewhere(name: str, digest: str) -> RuleResult:
    result = RuleResult(ANOTHER_PROCESS, None, False, "", 0.0)
    if not digest:
        return replace(result, message="needs same_start_same_episode", tried=False)
    try:
        again = afresh(_digest, name)
    except InputError as error:
        return replace(result, message=str(error))
    if again == digest:
        return replace(result, passed=True)
    return replace(result, message="the same episodes have other states or readings")


def _digest(name: str) -> str:
    digest = hashlib.sha256()
    for found in seen(get_task(name)):
        for array in (found.states, found.readings, found.success):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
