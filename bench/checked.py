"""The outcome of `bench check` and `bench check-task`, and how it is printed."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from textwrap import fill

import typer

from bench.doing import since_start
from bench.options import SOME_FAILED
from tasks.rule_results import RuleResult
from tasks.words import count_of

ANOTHER_PROCESS = "survives_another_process"
PRINTED = 3
"""Number of lines of output that are kept."""


@dataclass(frozen=True)
class Checked:
    """The outcome of a check."""

    results: tuple[RuleResult, ...]
    printed: tuple[str, ...] = ()
    """The first lines that the method or task printed."""
    lines: int = 0
    """How many lines it printed."""


def end_with(
    checked: Checked,
    name: str,
    rules: Mapping[str, Callable[..., None]],
    asks_elsewhere: str,
    as_json: bool,
) -> None:
    """Prints the outcome of a check, and ends the command with code 3 if a rule is broken.

    Args:
        checked: the outcome.
        name: of the method or task.
        rules: by name; their docstrings say what they ask for.
        asks_elsewhere: what the rule on another process asks for.
        as_json: whether to print a JSON list of results.

    Raises:
        typer.Exit: a rule is broken.
    """
    if as_json:
        print(json.dumps([asdict(result) for result in checked.results]))
    else:
        asks = {rule: check.__doc__ for rule, check in rules.items()}
        show(name, checked, asks | {ANOTHER_PROCESS: asks_elsewhere}, since_start())
    if not all(result.passed for result in checked.results):
        raise typer.Exit(SOME_FAILED)


def show(name: str, checked: Checked, asks: Mapping[str, str | None], seconds: float) -> None:
    """Prints the number of rules that hold, the broken rules, and the rules not tried.

    Args:
        name: of the method or task.
        checked: the outcome.
        asks: by rule, what it asks for.
        seconds: how long the check took.
    """
    import pandas as pd

    results = pd.DataFrame([asdict(result) for result in checked.results])
    variants = results.variant.nunique()
    asked = results[results.tried | ~results.passed]
    held = asked.groupby("rule", sort=False).passed.all()
    each = f" for each of {variants} variants" if variants > 1 else ""
    print(f"{name}: {held.sum()} of {len(held)} rules hold{each}, {seconds:.0f} s")
    broken = results[results.tried & ~results.passed]
    for (rule, message), rows in broken.groupby(["rule", "message"], sort=False):
        which = f" ({', '.join(rows.variant)})" if len(rows) < variants else ""
        print(f"BROKEN {rule}{which}: {message}")
        if asks.get(rule):
            print(f"       the rule: {(asks[rule] or '').strip()}")
    for reason, rows in results[~results.tried].groupby("message", sort=False):
        print(f"       not tried: {count_of(rows.rule.nunique(), 'rule')} ({reason})")
    if held.any():
        print(fill(f"ok     {', '.join(held.index[held])}", width=99, subsequent_indent=" " * 7))
    if checked.lines:
        print(f"It printed {count_of(checked.lines, 'line')}; the first are:")
        for line in checked.printed:
            print(f"       | {line}")
