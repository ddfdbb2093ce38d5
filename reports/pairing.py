"""Which evaluations are compared: those of methods, on common seeds and starts."""

from collections.abc import Iterable

import pandas as pd

from bench.labels import EXPERT

FEWEST = 2
"""The fewest common seeds to which fits of several seeds are cut."""


def without_expert(evaluations: pd.DataFrame) -> pd.DataFrame:
    """Returns the evaluations of methods."""
    return evaluations[evaluations.method != EXPERT]


def demos_of_expert(evaluations: pd.DataFrame) -> dict[str, str]:
    """Returns the keys of the expert's demonstrations, by task."""
    experts = evaluations[evaluations.method == EXPERT].drop_duplicates("task")
    return dict(zip(experts.task, experts.demos_key, strict=True))


def keep_common(evaluations: pd.DataFrame, by: str = "method") -> pd.DataFrame:
    """Returns evaluations cut, within each task, to common seeds and common starts.

    Common starts are the first ``episodes`` of the split. Groups that share fewer than two seeds
    keep all of theirs, see `reports.protocol.differences`. Methods without seeds have seed 0, which
    is always kept.

    Args:
        evaluations: as `bench.source.Source.frame` returns them, of one split.
        by: column whose groups must have the same seeds.
    """
    found = evaluations.reset_index(drop=True)
    for _, part in found.groupby("task"):
        seeds = common_seeds(set(group.seed) for _, group in part.groupby(by))
        if len(seeds) >= FEWEST:
            found = found.drop(part.index[~part.seed.isin(seeds | {0})])
    return found.assign(episodes=found.groupby("task").episodes.transform("min"))


def common_seeds(groups: Iterable[set[int]]) -> set[int]:
    """Returns the seeds that all groups share. Groups with seed 0 alone do not count."""
    seeds = [group - {0} for group in groups if group - {0}]
    return set.intersection(*seeds) if seeds else set()
