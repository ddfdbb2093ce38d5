"""Evaluations on the seeds and starts that all which are laid beside each other have."""

from collections.abc import Iterable

import pandas as pd

FEWEST = 2
"""Seeds in common with which fits of several seeds are still compared."""


def on_common_ground(evaluations: pd.DataFrame, by: str = "method") -> pd.DataFrame:
    """Returns evaluations cut to the seeds that all methods of a task have, and to common starts.

    Starts are the first ``episodes`` of their split. Methods without common seeds keep their own,
    see `reports.protocol.differences`. A method without seeds has 0, and stands for all of them.

    Args:
        evaluations: as `bench.source.Source.frame` gives them, of one split.
        by: column that tells apart whose seeds are to be the same.
    """
    found = evaluations.reset_index(drop=True)
    for _, part in found.groupby("task"):
        seeds = common_seeds(set(group.seed) for _, group in part.groupby(by))
        if len(seeds) >= FEWEST:
            found = found.drop(part.index[~part.seed.isin(seeds | {0})])
    return found.assign(episodes=found.groupby("task").episodes.transform("min"))


def common_seeds(groups: Iterable[set[int]]) -> set[int]:
    """Returns the seeds of all groups that have any but 0."""
    seeds = [group - {0} for group in groups if group - {0}]
    return set.intersection(*seeds) if seeds else set()
