"""Remarks on results: answers of a method that were not finite, and packages edited since."""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tasks.words import count_of

if TYPE_CHECKING:
    from bench.results import Results


def who_answers(method: str, variant: str, task: str, seeds: Sequence[int]) -> str:
    """Returns the name of a method in a message, such as ``nn published on door, seed 1``."""
    name = method if variant == "described" else f"{method} {variant}"
    noun = "seed" if len(seeds) == 1 else "seeds"
    return f"{name} on {task}, {noun} {', '.join(map(str, seeds))}"


def remarks(results: "Results", methods: Collection[str] | None = None) -> list[str]:
    """Returns a line for each method and task with such answers, and for each edited package.

    Args:
        results: the results.
        methods: those whose answers are remarked on. Default: all.
    """
    return [*_non_finite(results, methods), *_edited(results)]


def _edited(results: "Results") -> list[str]:
    """A line for each method or task whose package has other code than when results were computed.

    The key of a result holds the version of its method and task, but not their code.
    """
    from bench.package_source import code_of  # slow to import, and most results do without

    before = list(filter(None, results.code()))
    now = code_of(*{name for items in before for name, _ in items}) if before else {}
    stale = Counter(
        name for items in before for name in {n for n, code in items if now.get(n, code) != code}
    )
    return [
        f"the code of {name} has changed since {count_of(count, 'stored evaluation')} of it"
        f" {'was' if count == 1 else 'were'} computed: if it now gives other results, raise"
        " `version` in its class and run again"
        for name, count in sorted(stale.items())
    ]


def _non_finite(results: "Results", methods: Collection[str] | None) -> list[str]:
    """A line for each method and task with such answers in the requested evaluations.

    For example ``badact on door, seed 1: act returned NaN or inf for 17 of 20 starts, first at
    t=30; these episodes diverge there, which is a failure``. Evaluations and seeds are added up.
    """
    found: dict[tuple[str, str, str, str], list[_Said]] = {}
    for spec, episodes, chunks in results.non_finite():
        if methods is not None and spec["method"] not in methods:
            continue
        place = (spec["method"], spec["variant"], spec["task"], chunks[0].call)
        starts, first = sum(one.starts for one in chunks), min(one.first for one in chunks)
        found.setdefault(place, []).append(_Said(spec["seed"], starts, episodes, first))
    return [_line(*place, said) for place, said in found.items()]


@dataclass(frozen=True)
class _Said:
    """The episodes of one evaluation in which answers were not finite, and their first step."""

    seed: int
    starts: int
    episodes: int
    first: int


def _line(method: str, variant: str, task: str, call: str, said: Sequence[_Said]) -> str:
    who = who_answers(method, variant, task, sorted({one.seed for one in said}))
    starts, episodes = sum(one.starts for one in said), sum(one.episodes for one in said)
    where = f" in {len(said)} evaluations" if len(said) > 1 else ""
    first = min(one.first for one in said)
    return (
        f"{who}: {call} returned NaN or inf for {starts} of {count_of(episodes, 'start')}{where},"
        f" first at t={first}; these episodes diverge there, which is a failure"
    )
