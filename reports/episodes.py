"""Success of episodes: arrays on common seeds and starts, and rates with their intervals."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from bench.names import CONDITIONS
from reports.pairing import common_seeds, keep_common
from reports.seed_statistics import rate
from tasks.data import BoolArray

RATE = ("value", "spread", "low", "high", "basis", "seeds", "n")
"""Columns of a success rate in tables."""
Groups = dict[tuple[Any, ...], dict[int, BoolArray]]
"""Success (N,) of each seed of each group."""


class Episodes:
    """The episodes of evaluations. Each evaluation is read once."""

    def __init__(self, read: Callable[[dict[str, Any]], pd.DataFrame]) -> None:
        """Takes the function that reads the episodes of an evaluation, given its row.

        See `bench.source.Source.outcomes`.
        """
        self._read = read
        self._stored: dict[tuple[str, ...], BoolArray] = {}
        """Success and divergence (2, N), by folder and conditions of the evaluation."""

    def by_seed(self, evaluations: pd.DataFrame, by: Sequence[str]) -> Groups:
        """Returns success (N,) of each seed of each group of evaluations.

        Args:
            evaluations: rows of `reports.results.Results.frame`, of one split; a group has one for
                each seed.
            by: columns that tell the groups apart.
        """
        groups = evaluations.groupby(list(by), sort=False)
        return {
            names: dict(zip(rows.seed, (both[0] for both in self._outcomes(rows)), strict=True))
            for names, rows in groups
        }

    def paired(
        self, evaluations: pd.DataFrame, by: Sequence[str]
    ) -> dict[tuple[Any, ...], BoolArray]:
        """Returns success (R, N) of each group of evaluations, see `by_seed` and `on_common`."""
        return on_common(self.by_seed(evaluations, by))

    def of_selections(self, selections: Sequence[pd.DataFrame]) -> list[BoolArray | None]:
        """Returns success (R, N) of each selection of rows, as `paired` does.

        None for a selection without rows, and for all if the others share no seed.
        """
        parts = [rows.assign(place=i) for i, rows in enumerate(selections)]
        found = self.paired(pd.concat(parts), ["place"])
        return [found.get((i,)) for i in range(len(parts))]

    def rates(self, evaluations: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
        """Returns success [%] of each group of evaluations, see `reports.seed_statistics.rate`.

        Only common seeds and starts of a task count, see `reports.pairing.keep_common`.

        Columns: those of `by`, ``value`` the mean over seeds, ``spread`` their sample standard
        deviation, ``low`` and ``high`` the 95% interval, ``basis`` what it speaks of, ``seeds``,
        ``n`` starts of each seed, ``diverged`` episodes of all seeds.
        """
        groups = [name for name in by if name != "task"]
        rows = []
        for names, group in keep_common(evaluations, groups).groupby(list(by), sort=False):
            success, diverged = np.stack(self._outcomes(group.sort_values("seed")), axis=1)
            labels = dict(zip(by, names, strict=True))
            rows.append(labels | rate_facts(success) | {"diverged": int(diverged.sum())})
        return pd.DataFrame(rows, columns=[*by, *RATE, "diverged"])

    def _outcomes(self, rows: pd.DataFrame) -> list[BoolArray]:
        """Returns success and divergence (2, N) of the first ``episodes`` of each row."""
        places = zip(*(rows[name] for name in ("folder", *CONDITIONS)), strict=True)
        return [
            self._of_row(place, rows, i)[:, :count]
            for i, (place, count) in enumerate(zip(places, rows.episodes, strict=True))
        ]

    def _of_row(self, place: tuple[str, ...], rows: pd.DataFrame, i: int) -> BoolArray:
        """Returns success and divergence (2, N) of row i, which has that folder and conditions."""
        if place not in self._stored:
            found = self._read(rows.iloc[i].to_dict())
            self._stored[place] = np.stack([found["success"], found["diverged"]])
        return self._stored[place]


def on_common(groups: Groups) -> dict[tuple[Any, ...], BoolArray]:
    """Returns success (R, N) of each group on common seeds and starts.

    Row r of all arrays is the same seed, and column i the same start of that seed: one of its
    first, as many as all groups have. Empty if the groups share no seed.
    """
    seeds = sorted(common_seeds(map(set, groups.values())))
    if not seeds:
        return {}
    count = min(len(group[seed]) for group in groups.values() for seed in seeds)
    return {
        names: np.stack([group[seed][:count] for seed in seeds]) for names, group in groups.items()
    }


def rate_facts(success: BoolArray) -> dict[str, Any]:
    """Returns the columns `RATE` of a table of success [%], given success (R, N)."""
    found, shares = rate(success), 100 * success.mean(axis=1)
    spread = float(shares.std(ddof=1)) if found.seeds > 1 else np.nan
    ends = (100 * found.value, spread, 100 * found.low, 100 * found.high)
    return dict(zip(RATE, (*ends, found.basis, found.seeds, success.shape[1]), strict=True))
