"""The stored evaluations that an exhibit shows: of the paper's methods, or of all."""

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
import pandas as pd

from bench.controller_kinds import COMPARED
from bench.labels import EXPERT, plain
from bench.names import PLAIN
from bench.selection import best_validated
from methods.registry import CLOSED_LOOP
from tasks.data import BoolArray

Place = tuple[str, str]
"""A task and a method."""


class Rows:
    """Selects rows of a frame of evaluations, see `reports.results.Results.frame`."""

    def __init__(self, frame: pd.DataFrame) -> None:
        self.frame = frame

    def select(self, **values: object) -> pd.DataFrame:
        """Returns the evaluations with these values.

        Defaults: methods as described, nominal physics, success by appendix C, and the
        controllers of `bench.controller_kinds.COMPARED`. Unless it is named, no method `beyond` the
        paper is among them.
        """
        wanted = PLAIN | {"variant": "described"} | values
        keep = [self._where(name, value) for name, value in wanted.items()]
        if "controller" not in values:
            keep.append(self._compared)
        if "method" not in values:
            keep.append(self._not_beyond)
        return self.frame[np.logical_and.reduce(keep)]

    def _where(self, name: str, value: object) -> BoolArray:
        """Returns which rows of the frame have a value in a column, found once."""
        if (name, value) not in self._found:
            self._found[name, value] = (self.frame[name] == value).to_numpy(bool)
        return self._found[name, value]

    @cached_property
    def _found(self) -> dict[tuple[str, object], BoolArray]:
        """Cache of `_where`, by its arguments."""
        return {}

    @cached_property
    def _compared(self) -> BoolArray:
        return self.frame.controller.isin(COMPARED).to_numpy(bool)

    @cached_property
    def _not_beyond(self) -> BoolArray:
        return ~self.frame.method.isin(self.beyond).to_numpy(bool)

    @cached_property
    def beyond(self) -> frozenset[str]:
        """The methods that tables of the paper leave out: closed-loop ones, beside others."""
        found = frozenset(m for m in self.frame.method.unique() if plain(m) in CLOSED_LOOP)
        others = frozenset(self.frame.method.unique()) - found - {EXPERT}
        return found if others else frozenset()

    def methods(self, **values: object) -> list[str]:
        """Returns the methods that `select` finds, those `beyond` the paper among them."""
        return [m for m in self.frame.method.unique() if len(self.select(method=m, **values))]

    def every(self, **values: object) -> pd.DataFrame:
        """Returns what `select` finds for all methods, those `beyond` the paper among them."""
        return pd.concat(self.select(method=m, **values) for m in self.frame.method.unique())

    def of_all(self, **values: object) -> pd.DataFrame:
        """Returns the rows of `main` for all methods, those `beyond` the paper among them."""
        return self.at_one_size([self.every(**values)])[0]

    def main(self, **values: object) -> pd.DataFrame:
        """Returns the rows of `chosen` with the most demonstrations of each method."""
        return self.at_one_size([self.select(**values)])[0]

    def at_one_size(self, parts: Sequence[pd.DataFrame]) -> list[pd.DataFrame]:
        """Returns several selections, each method on each task at the same size in all of them.

        It is chosen, as in `chosen`, among the sizes that most selections have: two studies may
        have evaluated two sizes. Of each method the rows with the most demonstrations are kept.
        """
        sizes = self._sizes(parts)
        return [_with_most_demos(_of_size(part, sizes)) for part in parts]

    def chosen(self, **values: object) -> pd.DataFrame:
        """Returns the rows of `select` at the chosen size of each method."""
        found = self.select(**values)
        return _of_size(found, self._sizes([found]))

    def _sizes(self, parts: Sequence[pd.DataFrame]) -> dict[Place, str]:
        """Returns the size of each method on each task, see `at_one_size`."""
        known: dict[Place, Counter[str]] = {}
        for part in parts:
            for task, method, size in set(zip(part.task, part.method, part["size"], strict=True)):
                known.setdefault((task, method), Counter())[size] += 1
        return {
            place: self._best_size(
                *place, {size for size, count in counts.items() if count == max(counts.values())}
            )
            for place, counts in known.items()
        }

    def _best_size(self, task: str, method: str, sizes: set[str]) -> str:
        """Returns which of these sizes has the most success from validation starts.

        Those of fits with the most demonstrations decide, as in a run.
        """
        place = task, method, *sorted(sizes)
        if place not in self._best_sizes:
            validated = self.select(task=task, method=method, split="validation")
            self._best_sizes[place] = best_validated(validated, sorted(sizes))
        return self._best_sizes[place]

    @cached_property
    def _best_sizes(self) -> dict[tuple[str, ...], str]:
        """Cache of `_best_size`, by its arguments."""
        return {}


def _of_size(found: pd.DataFrame, sizes: Mapping[Place, str]) -> pd.DataFrame:
    places = zip(found.task, found.method, strict=True)
    return found[found["size"].to_numpy() == np.array([sizes[place] for place in places], object)]


def _with_most_demos(found: pd.DataFrame) -> pd.DataFrame:
    if found.demos.nunique() < 2:
        return found  # most selections are such, and grouping them takes long
    return found[found.demos == found.groupby(["task", "method"]).demos.transform("max")]
