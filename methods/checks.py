"""Checks a method against every rule of the contract, in each of its variants.

The demonstrations are synthetic, and as long and as wide as those of a task (`methods.toy`). To
check your own method in a test:

    @pytest.mark.parametrize("rule", RULES)
    def test_my_method(rule):
        RULES[rule](MyMethod)
"""

from collections.abc import Callable, Iterator
from functools import partial, wraps

from methods import closed_loop_rules, rules
from methods.base import Method
from methods.subject import Subject, subjects
from tasks.rule_results import RuleBrokenError, RuleResult, run_rules, try_rule

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


def check(method: type[Method]) -> Iterator[RuleResult]:
    """Yields the result of each rule on each variant, as soon as it is known.

    See `tasks.rule_results.run_rules`.
    """
    whole = try_rule(DECLARED, partial(rules.declared, method))
    yield whole
    if whole.passed:
        for subject in subjects(method):
            yield from check_variant(subject)
    else:
        for name in VARIANT_RULES:
            yield RuleResult(name, None, False, f"needs {DECLARED}", 0.0, tried=False)


def check_variant(subject: Subject) -> Iterator[RuleResult]:
    """Yields the result of each rule but `declared` on one variant, see `check`."""
    bound = {name: partial(rule, subject) for name, rule in VARIANT_RULES.items()}
    yield from run_rules(bound, lambda name: NEEDS.get(name, NEEDED), subject.variant)


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
