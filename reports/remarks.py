"""Sentences for captions about methods and controllers that learnt from other demonstrations."""

from collections.abc import Iterable
from dataclasses import dataclass

import pandas as pd

from bench.controller_kinds import AUDITED, TUNED
from bench.labels import EXPERT
from reports.pairing import demos_of_expert, without_expert
from reports.style import display, ordered
from tasks.registry import TASKS

OWN = " (suite's own)"
"""Text after the expert's name where methods did not learn from the expert's demonstrations."""


@dataclass(frozen=True)
class Remark:
    """A sentence for the captions of some exhibits: of those that show its names and tasks."""

    text: str
    names: frozenset[str]
    """Methods or controllers, one of which the exhibit must show."""
    tasks: frozenset[str]
    """Tasks, one of which the exhibit must show."""

    def concerns(self, shown: Iterable[str]) -> bool:
        """Returns whether it concerns an exhibit that shows these words.

        An exhibit that names no task shows all tasks.
        """
        tasks = set(shown).intersection(TASKS)
        return not self.names.isdisjoint(shown) and (not tasks or not self.tasks.isdisjoint(tasks))


def remarks_on_the_expert(frame: pd.DataFrame) -> list[Remark]:
    """Returns the remarks on tasks where methods did not learn from the expert's demonstrations.

    Args:
        frame: as `bench.source.Source.frame` returns it.
    """
    own = demos_of_expert(frame)
    learnt = without_expert(frame)
    found = zip(learnt.task, learnt.pins, learnt.demos_key, strict=True)
    tasks = ordered((task for task, pins, key in found if own.get((task, pins), key) != key), TASKS)
    if not tasks:
        return []
    place = ", ".join(map(display, tasks))
    learnt = "the methods learnt from other demonstrations"
    expert = f"On {place}, the expert is the suite's own; {learnt}."
    tuned = f"On {place}, tuned and unclipped controllers learnt from the suite's expert; {learnt}."
    return [
        Remark(expert, frozenset({EXPERT}), frozenset(tasks)),
        Remark(tuned, frozenset({TUNED, *AUDITED}), frozenset(tasks)),
    ]
