"""Which evaluations are compared: those of common seeds, from the common first starts of each.

A seed has starts of its own: start i of one seed is another start than start i of the next. So two
methods are paired within each seed, and nothing is paired across seeds.
"""

from collections.abc import Iterable, Sequence

import pandas as pd

from bench.labels import EXPERT

FEWEST = 2
"""The fewest common seeds to which groups with several seeds are cut."""


def without_expert(evaluations: pd.DataFrame) -> pd.DataFrame:
    """Returns the evaluations of methods."""
    return evaluations[evaluations.method != EXPERT]


def demos_of_expert(evaluations: pd.DataFrame) -> dict[tuple[str, str], str]:
    """Returns the keys of the expert's demonstrations, by task and mark of the kernels."""
    experts = evaluations[evaluations.method == EXPERT]
    places = zip(experts.task, experts.pins, strict=True)
    return dict(zip(places, experts.demos_key, strict=True))


def keep_common(
    evaluations: pd.DataFrame, by: Sequence[str] = ("method",), within: Sequence[str] = ("task",)
) -> pd.DataFrame:
    """Returns evaluations cut, within each task, to common seeds and common starts.

    ``episodes`` becomes the number of common starts: the first of each seed that all have. The
    methods decide on the seeds, and the expert follows. Groups that share fewer than two seeds keep
    all of theirs: those are shown, and compared only if they are `same_seeds`.

    Args:
        evaluations: as `bench.source.Source.frame` returns them, of one split.
        by: columns whose groups must have the same seeds.
        within: columns within whose groups seeds and starts are common. Empty: within all.
    """
    if evaluations.empty:
        return evaluations
    found = evaluations.reset_index(drop=True)
    places = [part for _, part in found.groupby(list(within))] if within else [found]
    return pd.concat([_cut(part, by) for part in places]).sort_index()


def _cut(part: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    learnt = without_expert(part)
    deciding = part if learnt.empty else learnt
    seeds = common_seeds(set(group.seed) for _, group in deciding.groupby(list(by)))
    if len(seeds) < FEWEST:
        seeds = set(part.seed)
    shared = part[part.seed.isin(seeds)]
    return shared.assign(episodes=shared.episodes.min())


def same_seeds(evaluations: pd.DataFrame) -> bool:
    """Whether all methods, the expert left out, have the same seeds on each task."""
    learnt = without_expert(evaluations)
    seeds = learnt.groupby(["task", "method"]).seed.agg(frozenset)
    return all(mine.nunique() == 1 for _, mine in seeds.groupby("task"))


def common_seeds(groups: Iterable[set[int]]) -> set[int]:
    """Returns the seeds that all groups share."""
    seeds = list(groups)
    return set.intersection(*seeds) if seeds else set()
