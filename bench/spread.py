"""How much the difference of two methods varies over seeds, estimated from stored results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

from bench.controller_kinds import ORIGINAL
from bench.names import PLAIN
from bench.power import pooled
from bench.presets import get_preset
from bench.selection import chosen_sizes, used_size
from methods.registry import PAPER, SUITE, TO_BEAT, get_method

if TYPE_CHECKING:
    import pandas as pd

FEWEST = 3
"""Common seeds of two methods from which a standard deviation is estimated."""


@dataclass(frozen=True)
class Spread:
    """Standard deviations over seeds of the difference of two methods' success rates, in points."""

    deviations: Mapping[str, Sequence[float]]
    """By task, that of each pair of methods with `FEWEST` or more common seeds; at least one."""
    methods: tuple[str, ...]
    """The methods of these pairs."""
    seeds: tuple[int, int]
    """The fewest and the most common seeds of a pair."""
    episodes: int
    """The fewest episodes of a seed's evaluation."""
    one_controller: bool
    """Whether all seeds of some method on a task were evaluated with the same controller. Then the
    deviations lack what controllers of their own would add."""

    @property
    def overall(self) -> float:
        """That of all pairs and tasks, see `bench.power.pooled`."""
        return pooled(value for values in self.deviations.values() for value in values)

    @property
    def by_task(self) -> dict[str, float]:
        """That of the pairs of each task, see `bench.power.pooled`."""
        return {task: pooled(values) for task, values in self.deviations.items()}


def spread_over_seeds(frame: pd.DataFrame, tasks: Sequence[str]) -> Spread | None:
    """Returns the spread of the suite's methods on some tasks; None with too few common seeds.

    Methods that act in each state are left out: they vary least, and would promise too much.
    Counted are evaluations from starts of ``test`` in nominal physics, of fits as described to the
    most demonstrations, at that of their sizes which does best on validation starts (else the
    default size), with the original controller.

    Args:
        frame: stored evaluations, see `bench.source.Source.frame`.
        tasks: the tasks to consider.
    """
    rows = _compared(frame, tasks)
    pairs = list(_pairs(rows))
    if not pairs:
        return None
    deviations: dict[str, list[float]] = {}
    for task, _, gaps in pairs:
        deviations.setdefault(task, []).append(float(gaps.std(ddof=1)))
    counts = [len(gaps) for _, _, gaps in pairs]
    found = {name for _, names, _ in pairs for name in names}
    tracked = rows[rows.method.isin(found) & (rows.controller_key != "")]
    numbers = tracked.groupby(["task", "method"])[["seed", "controller_key"]].nunique()
    return Spread(
        deviations,
        tuple(name for name in SUITE if name in found),
        (min(counts), max(counts)),
        int(rows[rows.method.isin(found)].episodes.min()),
        bool(((numbers.seed >= FEWEST) & (numbers.controller_key == 1)).any()),
    )


def _pairs(rows: pd.DataFrame) -> Iterator[tuple[str, tuple[str, str], pd.Series[float]]]:
    """Yields task, methods and each common seed's difference in points, if there are enough."""
    rates = rows.assign(rate=100 * rows.successes / rows.episodes)
    for task, part in rates.groupby("task", sort=False):
        by_seed = part.pivot(index="seed", columns="method", values="rate")
        for left, right in combinations(by_seed, 2):
            gaps = (by_seed[left] - by_seed[right]).dropna()
            if len(gaps) >= FEWEST:
                yield str(task), (str(left), str(right)), gaps


def _compared(frame: pd.DataFrame, tasks: Sequence[str]) -> pd.DataFrame:
    """The evaluations of the suite's methods that are compared, one for each seed."""
    paper = get_preset("paper")
    rows = frame[
        frame.task.isin(tasks)
        & frame.method.isin((*PAPER, *TO_BEAT))
        & (frame.split == "test")
        & frame[[*PLAIN]].eq(list(PLAIN.values())).all(axis=1)
        & (frame.variant == "described")
        & (frame.settings == "")
        & (frame.expert == paper.taught_by)
        & (frame.weights == "")
        & (frame.held_out == 0)
        & (frame.controller == ORIGINAL)
    ]
    sizes = {
        (task, name): _size(task, name, tuple(part["size"].unique()), frame)
        for (task, name), part in rows.groupby(["task", "method"])
    }
    used = [sizes[place] for place in zip(rows.task, rows.method, strict=True)]
    rows = rows[rows["size"] == used]
    return rows[rows.demos == rows.groupby(["task", "method"]).demos.transform("max")]


def _size(task: str, name: str, sizes: tuple[str, ...], frame: pd.DataFrame) -> str:
    """The one of some sizes that does best on validation starts; else the default."""
    study = replace(get_preset("paper"), tasks=(task,), methods=(name,), sizes=sizes)
    return used_size(study, get_method(name), task, chosen_sizes(study, frame))
