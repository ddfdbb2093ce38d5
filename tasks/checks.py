"""Checks a task against every rule.

In a test of your own:

    @pytest.mark.parametrize("rule", RULES)
    def test_my_task(rule):
        RULES[rule](MyTask)
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial, wraps

from tasks import model_rules, rules
from tasks.base import Task
from tasks.observed import made
from tasks.rule_results import RuleResult, run_rules


def _of_class(rule: Callable[[Task], None]) -> Callable[[type[Task]], None]:
    @wraps(rule)
    def check_class(kind: type[Task]) -> None:
        rule(made(kind))

    return check_class


RULES: dict[str, Callable[[type[Task]], None]] = {
    rule.__name__: _of_class(rule)
    for rule in (
        model_rules.declared,
        rules.starts_in_range,
        rules.answers,
        rules.starts_show_in_the_state,
        rules.same_start_same_episode,
        rules.threads_and_grouping,
        rules.reading_changes_nothing,
        rules.reads_the_present,
        rules.components_are_where_they_say,
        rules.success_judges_each_episode,
        rules.random_actions_fail,
        rules.decided_is_final,
        rules.expert_demonstrates,
        model_rules.physics_touches_what_it_names,
        model_rules.actuators_are_those_of_the_file,
    )
}
"""Every rule by its name, as a function that raises `RuleBrokenError` if a class breaks it."""
FIRST = ("declared", "starts_in_range", "answers")
"""Rules that must hold, in this order, before the others are tried."""
ON_THE_MODEL = ("physics_touches_what_it_names", "actuators_are_those_of_the_file")
"""Rules that need only the first of these."""


def check(kind: type[Task]) -> Iterator[RuleResult]:
    """Yields the result of each rule, as soon as it is known, see `run_rules`."""
    return run_rules({name: partial(rule, kind) for name, rule in RULES.items()}, _needed)


def _needed(rule: str) -> Sequence[str]:
    if rule in FIRST:
        return FIRST[: FIRST.index(rule)]
    return FIRST[:1] if rule in ON_THE_MODEL else FIRST
