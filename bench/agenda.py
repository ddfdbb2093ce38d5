"""Lists the cells of a study. Some depend on model sizes that a run has yet to choose.

The experiment `sizes` compares the sizes of each method on each task; the best one is used in all
other experiments. Until its evaluations exist, the default size stands for it in estimates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import pandas as pd

from bench.costs import Cost
from bench.doing import say
from bench.experiments import cells_of, first_wave
from bench.missing import find_missing
from bench.presets import Study
from bench.results import Results
from bench.selection import chosen_sizes
from bench.spec import Cell
from bench.training_data import wanted_episodes

Pair = tuple[str, str]
"""A task and a method."""


@dataclass(frozen=True)
class Choice:
    """A size of a method on a task that is still to be chosen.

    It waits in the queue among the jobs of a run. The process of the run makes the choice.
    """

    pair: Pair
    compared: tuple[Cell, ...]
    """The evaluations that decide."""
    expected: tuple[Cell, ...]
    """The cells that follow, if the default size is chosen."""
    kind: ClassVar = "choices"
    cost: ClassVar = Cost("choice", 0.0)
    needs: ClassVar[tuple[str, ...]] = ()

    @property
    def label(self) -> str:
        """A name for people."""
        return f"size of {self.pair[1]} on {self.pair[0]}"

    @property
    def makes(self) -> tuple[str, ...]:
        """The key for which the jobs wait that depend on the choice."""
        return (self.label,)

    @cached_property
    def after(self) -> tuple[str, ...]:
        """The keys of the evaluations that decide."""
        return tuple(cell.evaluation.key(cell.fit) for cell in self.compared)

    def parts(self) -> Sequence["Choice"]:
        """Returns itself."""
        return [self]


@dataclass(frozen=True)
class Agenda:
    """The cells of a study."""

    known: Sequence[Cell]
    choices: Sequence[Choice]

    @property
    def cells(self) -> list[Cell]:
        """All cells; with the default size where the size is still to be chosen."""
        return [*self.known, *(cell for choice in self.choices for cell in choice.expected)]


def make_agenda(study: Study, demos_keys: Mapping[str, str], results: Results) -> Agenda:
    """Returns the cells of a study, given the stored results.

    Raises:
        InputError: see `bench.experiments.cells_of`.
    """
    cells_of(study, demos_keys)  # bad options are refused before results are read
    say("looking for missing results")
    first = _possible(first_wave(study, demos_keys))
    missing = find_missing(results, [cell.wanted for cell in first])
    open_pairs = {
        _pair(cell) for cell in first if cell.evaluation.key(cell.fit) in missing.evaluations
    }
    sizes = {pair: {cell.fit.size for cell in first if _pair(cell) == pair} for pair in open_pairs}
    undecided = {pair for pair in open_pairs if len(sizes[pair]) > 1}
    decided = [cell for cell in first if _pair(cell) not in undecided]
    cells = _possible(cells_of(study, demos_keys, _chosen(study, results, decided)))
    compared = {_place(cell) for cell in first}
    waiting = [cell for cell in cells if _pair(cell) in undecided and _place(cell) not in compared]
    places = {_place(cell) for cell in waiting}
    return Agenda(
        [cell for cell in cells if _place(cell) not in places],
        [
            Choice(
                pair,
                tuple(cell for cell in first if _pair(cell) == pair),
                tuple(cell for cell in waiting if _pair(cell) == pair),
            )
            for pair in sorted(undecided)
        ],
    )


def choose(
    study: Study, demos_keys: Mapping[str, str], results: Results, choice: Choice
) -> list[Cell]:
    """Returns the cells of a method on a task, now that the evaluations that decide have ended."""
    chosen = _chosen(study, results, choice.compared)
    cells = cells_of(study, demos_keys, chosen)
    return _possible([cell for cell in cells if _pair(cell) == choice.pair])


def _chosen(study: Study, results: Results, compared: Sequence[Cell]) -> dict[Pair, str]:
    """The sizes that stored evaluations decide."""
    rows: list[dict[str, Any]] = []
    for cell in compared:
        found = results.episodes(cell.wanted)
        if found is not None:
            counts = {"successes": int(found.success.sum()), "episodes": len(found)}
            rows.append(asdict(cell.fit) | asdict(cell.evaluation) | counts)
    return chosen_sizes(study, pd.DataFrame(rows))


def _possible(cells: Sequence[Cell]) -> list[Cell]:
    """The cells, each with no more episodes than there are starts."""
    return [replace(cell, episodes=wanted_episodes(cell)) for cell in cells]


def _pair(cell: Cell) -> Pair:
    return cell.fit.task, cell.fit.method


def _place(cell: Cell) -> tuple[str, str]:
    return cell.fit.key, cell.evaluation.name
