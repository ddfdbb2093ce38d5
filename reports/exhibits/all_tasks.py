"""Success over all tasks of the paper together."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from reports.episodes import rate_facts
from reports.exhibit import Exhibit
from reports.exhibits.success import with_letters
from reports.pairing import keep_common
from reports.pairs import pairs_of_table
from reports.results import SPLITS, Results
from reports.style import METHODS
from reports.tables import in_order, table_of
from tasks.data import BoolArray
from tasks.registry import TASKS

MEAN, MIDDLE = "mean", "interquartile mean"


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method with results on all tasks, and two columns for each split.

    Letters and ``detectable`` are those of `reports.exhibits.success`, for the means.
    """
    parts = []
    for split in SPLITS:
        found = of_all_tasks(results.rows.main(split=split))
        pairs = pairs_of_table(results, found)
        for statistic in (MEAN, MIDDLE):
            rows = []
            for method, mine in found.groupby("method", sort=False):
                tasks = [*results.episodes.paired(mine, ["task"]).values()]
                if tasks:
                    episodes = of_seeds(tasks, statistic == MIDDLE)
                    place = {"row": method, "column": f"{split} {statistic}"}
                    rows.append(place | rate_facts(episodes) | {"n": tasks[0].shape[1]})
            if rows:
                part = pd.DataFrame(rows)
                parts.append(with_letters(part, pairs) if statistic == MEAN else part)
    if not parts:
        return table_of()
    columns = [f"{split} {statistic}" for split in SPLITS for statistic in (MEAN, MIDDLE)]
    whole = pd.concat(parts, ignore_index=True)
    return in_order(whole.fillna({"letters": ""}), METHODS, columns)


def of_all_tasks(found: pd.DataFrame, by: Sequence[str] = ("method",)) -> pd.DataFrame:
    """Returns the evaluations of methods with results on all tasks of the paper, and only those.

    They are on common seeds and starts. Tasks of packages do not count.

    Args:
        found: the evaluations.
        by: columns that tell methods apart.
    """
    found = found[found.task.isin(TASKS)]
    tasks = found.groupby(list(by)).task.transform("nunique")
    return keep_common(found[tasks == len(TASKS)], [*by, "task"], within=[])


def of_seeds(tasks: list[BoolArray], in_the_middle: bool) -> BoolArray:
    """Returns the episodes of each seed on all tasks.

    Args:
        tasks: success (R, N) on each of K tasks.
        in_the_middle: whether to leave out the tasks with the lowest and the highest rate of a
            seed.

    Returns:
        Success (R, K N), or (R, (K - 2) N).
    """
    success = np.stack(tasks, axis=1)
    if in_the_middle:
        order = success.mean(axis=2).argsort(axis=1, kind="stable")[:, 1:-1]
        success = np.take_along_axis(success, order[..., None], axis=1)
    return success.reshape(len(success), -1)


EXHIBIT = Exhibit(
    name="all_tasks",
    title="All tasks together",
    about=(
        "Success [%] over tasks, one value for each seed: the mean, and the interquartile mean,"
        " which leaves out the seed's worst and best task. Starts are those of each task. Not in"
        " the paper."
    ),
    table=table,
)
