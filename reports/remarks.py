"""What captions say of methods and controllers that were made otherwise than others beside them."""

from collections.abc import Iterable
from dataclasses import dataclass

import pandas as pd

from bench.controller_kinds import ON_SUCCESSES, TUNED, UNCLIPPED
from bench.labels import EXPERT
from reports.style import TASKS, display, ordered

OWN = " (suite's own)"
"""Follows the expert's name where methods learnt from other demonstrations than the expert's."""


@dataclass(frozen=True)
class Remark:
    """A sentence for the captions of the exhibits that it concerns."""

    text: str
    names: frozenset[str]
    """It concerns exhibits that show one of these methods or controllers ..."""
    tasks: frozenset[str]
    """... on one of these tasks."""

    def concerns(self, shown: Iterable[str]) -> bool:
        """Whether it concerns an exhibit that shows these; one that names no task shows all."""
        tasks = set(shown).intersection(TASKS)
        return not self.names.isdisjoint(shown) and (not tasks or not self.tasks.isdisjoint(tasks))


def remarks_on_the_expert(frame: pd.DataFrame) -> list[Remark]:
    """Returns what to say where methods learnt from other demonstrations than the suite's expert's.

    Args:
        frame: as `bench.source.Source.frame` gives it.
    """
    recipes = frame[frame.method == EXPERT].drop_duplicates("task").set_index("task").demos_key
    methods = frame[(frame.method != EXPERT) & frame.task.isin(recipes.index)]
    others = methods[methods.demos_key != methods.task.map(recipes)]
    tasks = ordered(others.task, TASKS)
    if not tasks:
        return []
    place = ", ".join(map(display, tasks))
    learnt = "the methods learnt from other demonstrations"
    expert = f"On {place}, the expert is the suite's own; {learnt}."
    tuned = f"On {place}, tuned and unclipped controllers learnt from the suite's expert; {learnt}."
    return [
        Remark(expert, frozenset({EXPERT}), frozenset(tasks)),
        Remark(tuned, frozenset({TUNED, ON_SUCCESSES, UNCLIPPED}), frozenset(tasks)),
    ]
