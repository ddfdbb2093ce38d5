"""Checks a method against every rule of the contract, in each of its variants.

The demonstrations are synthetic, and as long and as wide as those of a task (`methods.toy`). To
check your own method in a test:

    @pytest.mark.parametrize("rule", RULES)
    def test_my_method(rule):
        RULES[rule](MyMethod)
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial, wraps
from time import perf_counter

from methods import closed_loop_rules, rules
from methods.base import Method
from methods.contract import ContractError
from methods.judging import RuleBrokenError, UntriedError
from methods.subject import Subject, subjects
from tasks.errors import described

DECLARED = rules.declared.__name__
VARIANT_RULES: dict[str, Callable[[Subject], None]] = {
    rule.__name__: rule
    for rule in (
        rules.unfitted_raises,
        rules.fits,
        rules.answers,
        rules.finite,
        rules.begins_at_the_start,
        rules.same_start_same_answer,
        rules.same_seed_same_answer,
        rules.seeds_alone_or_together,
        rules.batch_invariance,
        closed_loop_rules.ended_episodes_ignored,
        closed_loop_rules.actions_in_range,
        closed_loop_rules.replans_from_any_state,
        closed_loop_rules.replans_alone_or_together,
        closed_loop_rules.replans_onward,
        rules.states_untouched,
        rules.process_untouched,
        rules.global_streams_unused,
        rules.survives_storage,
        rules.beats_holding_still,
    )
}
NEEDED = (DECLARED, "fits", "answers")
"""The rules that must hold before a rule is tried, unless `NEEDS` says otherwise."""
REPEATS = (*NEEDED, "same_start_same_answer")
NEEDS = {
    "unfitted_raises": NEEDED[:1],
    "fits": NEEDED[:1],
    "answers": NEEDED[:2],
    "same_seed_same_answer": REPEATS,
    "survives_storage": REPEATS,
    "batch_invariance": REPEATS,
    "seeds_alone_or_together": (*NEEDED, "same_seed_same_answer"),
    "global_streams_unused": (*NEEDED, "same_seed_same_answer"),
    "ended_episodes_ignored": (*REPEATS, "batch_invariance"),
    "actions_in_range": (*NEEDED, "finite"),
    "replans_from_any_state": (*NEEDED, "finite"),
    "replans_alone_or_together": (*REPEATS, "batch_invariance", "replans_from_any_state"),
    "replans_onward": (*REPEATS, "replans_from_any_state"),
}


@dataclass(frozen=True)
class RuleResult:
    """The result of one rule on one variant."""

    rule: str
    variant: str | None
    """None for a rule on the class as a whole."""
    passed: bool
    message: str
    """Why the rule is broken, or was not tried; empty if it holds."""
    seconds: float
    tried: bool = True
    """False if the rule needs another one that is broken, or fails with the same error. The message
    then names that rule: ``needs RULE``, or ``meets the error of RULE``."""


def check(method: type[Method]) -> Iterator[RuleResult]:
    """Yields the result of each rule on each variant, as soon as it is known.

    A rule that raises anything is broken. A rule that needs a broken one, or fails with the same
    error, counts as not tried, so that each fault is reported once.
    """
    whole = _tried(DECLARED, None, partial(rules.declared, method), {})
    yield whole
    if whole.passed:
        for subject in subjects(method):
            yield from check_variant(subject)
    else:
        for name in VARIANT_RULES:
            yield RuleResult(name, None, False, f"needs {DECLARED}", 0.0, tried=False)


def check_variant(subject: Subject) -> Iterator[RuleResult]:
    """Yields the result of each rule but `declared` on one variant, see `check`."""
    reasons: dict[str, str] = {}
    """For each rule that does not hold: the message of a rule that needs it."""
    first: dict[str, str] = {}
    """For each message: the first rule that is broken with it."""
    for name, rule in VARIANT_RULES.items():
        result = _tried(name, subject.variant, partial(rule, subject), reasons)
        if result.tried and result.message in first:
            same = f"meets the error of {first[result.message]}"
            result = replace(result, message=same, tried=False)
        if not result.passed:
            reasons[name] = f"needs {name}" if result.tried else result.message
        if result.tried and not result.passed:
            first[result.message] = name
        yield result


def _tried(
    name: str, variant: str | None, rule: Callable[[], None], reasons: Mapping[str, str]
) -> RuleResult:
    for needed in NEEDS.get(name, NEEDED):
        if needed in reasons:
            return RuleResult(name, variant, False, reasons[needed], 0.0, tried=False)
    began = perf_counter()
    message, tried = _fault(rule)
    return RuleResult(name, variant, not message, message, perf_counter() - began, tried)


def _fault(rule: Callable[[], None]) -> tuple[str, bool]:
    """Why a rule does not hold, or an empty text; and whether it could be tried."""
    try:
        rule()
    except UntriedError as error:
        return f"needs {error}", False
    except (RuleBrokenError, ContractError) as error:
        return str(error), True
    except BaseException as error:
        return described(error), True
    return "", True


def _in_every_variant(rule: Callable[[Subject], None]) -> Callable[[type[Method]], None]:
    @wraps(rule)
    def check_method(method: type[Method]) -> None:
        for subject in subjects(method):
            try:
                rule(subject)
            except RuleBrokenError as error:
                raise RuleBrokenError(f"variant {subject.variant!r}: {error}") from error

    return check_method


RULES: dict[str, Callable[[type[Method]], None]] = {
    DECLARED: rules.declared,
    **{name: _in_every_variant(rule) for name, rule in VARIANT_RULES.items()},
}
"""Every rule by its name, as a function that raises `RuleBrokenError` if a class breaks it."""
