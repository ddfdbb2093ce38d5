"""Finds what a results folder still lacks, for `bench run`, `plan` and `status` alike.

Stored results count only if they are undamaged.
"""

from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass
from typing import NamedTuple

from bench.manifest import Wanted
from bench.results import Results
from tasks.simulator import CHUNK


class Gap(NamedTuple):
    """The missing episodes of an evaluation."""

    kept: int
    """Stored episodes that are kept: whole chunks."""
    wanted: int
    """Episodes after the gap is filled."""


@dataclass(frozen=True)
class Missing:
    """Missing results, by key."""

    controllers: frozenset[str]
    fits: frozenset[str]
    """Without experts, which are not fitted."""
    evaluations: Mapping[str, Gap]

    @property
    def episodes(self) -> int:
        """Episodes to simulate, of all evaluations."""
        return sum(gap.wanted - gap.kept for gap in self.evaluations.values())

    def without(self, keys: Set[str]) -> "Missing":
        """Returns the missing results without those of some keys."""
        evaluations = {key: gap for key, gap in self.evaluations.items() if key not in keys}
        return Missing(self.controllers - keys, self.fits - keys, evaluations)


def find_missing(results: Results, wanted: Iterable[Wanted]) -> Missing:
    """Returns which evaluations, and which fits and controllers that they need, are missing."""
    by_key: dict[str, Wanted] = {}
    for one in wanted:
        known = by_key.setdefault(one.evaluation.key, one)
        by_key[one.evaluation.key] = max(known, one, key=lambda other: other.episodes)
    controllers = {name.key: name for one in by_key.values() for name in one.controllers}
    fits = {one.fit.key: one.fit for one in by_key.values()}
    missing_fits = {key for key, fit in fits.items() if not results.has_fit(fit)}
    acting = {one.fit.key for one in by_key.values() if not one.fitted}
    evaluations = {}
    for key, one in by_key.items():
        stored = 0 if one.fit.key in missing_fits else results.stored_episodes(one)
        if stored < one.episodes:
            evaluations[key] = Gap(stored // CHUNK * CHUNK, one.episodes)
    return Missing(
        frozenset(key for key, name in controllers.items() if not results.has_controller(name)),
        frozenset(missing_fits - acting),
        evaluations,
    )
