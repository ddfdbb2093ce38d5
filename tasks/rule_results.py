"""Runs the rules that a method or a task must keep, and reports each fault once.

A rule is a function that raises `RuleBrokenError` if it is broken.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from unittest import SkipTest

from tasks.errors import reason_of

Needs = Callable[[str], Sequence[str]]
"""Returns the rules that must hold before the rule of a name is tried."""


class RuleBrokenError(AssertionError):
    """A rule is broken; the message gives the reason."""


class NotAskedError(SkipTest):
    """A rule asks for nothing, since a task lacks what it is about. A test that runs it skips."""


class UntriedError(Exception):
    """A rule cannot be tried because the rule that the message names is broken."""


@dataclass(frozen=True)
class RuleResult:
    """The result of one rule on one variant of a method, or on a task."""

    rule: str
    variant: str | None
    """None for a rule on the whole."""
    passed: bool
    message: str
    """Why the rule is broken, or was not tried; empty if it holds."""
    seconds: float
    tried: bool = True
    """False if the rule needs another one that is broken, or fails with the same error. The message
    then names that rule: ``needs RULE``, or ``meets the error of RULE``. False too, though passed,
    if the rule asks for nothing; the message then says why."""


def require(holds: object, message: str) -> None:
    """Raises RuleBrokenError with a message unless something holds."""
    if not holds:
        raise RuleBrokenError(message)


def run_rules(
    rules: Mapping[str, Callable[[], None]], needs: Needs, variant: str | None = None
) -> Iterator[RuleResult]:
    """Yields the result of each rule, as soon as it is known.

    A rule that raises anything is broken. A rule that needs a broken one, or fails with the same
    error, counts as not tried.

    Args:
        rules: by name, in the order in which they are tried.
        needs: which rules each of them needs.
        variant: for the results.
    """
    reasons: dict[str, str] = {}
    """For each rule that does not hold: the message of a rule that needs it."""
    first: dict[str, str] = {}
    """For each message: the first rule that is broken with it."""
    for name, rule in rules.items():
        needed = [reasons[one] for one in needs(name) if one in reasons]
        if needed:
            result = RuleResult(name, variant, False, needed[0], 0.0, tried=False)
        else:
            result = try_rule(name, rule, variant)
        if result.tried and result.message in first:
            same = f"meets the error of {first[result.message]}"
            result = replace(result, message=same, tried=False)
        if not result.passed:
            reasons[name] = f"needs {name}" if result.tried else result.message
        if result.tried and not result.passed:
            first[result.message] = name
        yield result


def try_rule(name: str, rule: Callable[[], None], variant: str | None = None) -> RuleResult:
    """Returns the result of one rule, which needs no other."""
    began = perf_counter()
    try:
        message, tried = _fault(rule)
    except NotAskedError as error:
        return RuleResult(name, variant, True, str(error), perf_counter() - began, tried=False)
    return RuleResult(name, variant, not message, message, perf_counter() - began, tried)


def _fault(rule: Callable[[], None]) -> tuple[str, bool]:
    """Why a rule does not hold, or an empty text; and whether it could be tried."""
    try:
        rule()
    except NotAskedError:
        raise
    except UntriedError as error:
        return f"needs {error}", False
    except RuleBrokenError as error:
        return str(error), True
    except BaseException as error:
        return reason_of(error), True
    return "", True
