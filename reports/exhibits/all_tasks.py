"""Success over all tasks together."""

from collections.abc import Sequence

import pandas as pd

from reports.exhibit import Exhibit
from reports.results import SPLITS, Results
from reports.stats import mean_over_tasks
from reports.style import METHODS, TASKS
from reports.tables import in_order
from tasks.data import BoolArray

TRIMMED = {"mean": 0.0, "interquartile mean": 0.25}
"""Share of the rates that a statistic leaves out at either end."""


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method with results on all tasks, and two columns for each split."""
    rows = []
    for split in SPLITS:
        methods = _with_all_tasks(results, split)
        outcomes = [_outcomes(results, methods, task, split) for task in TASKS]
        for method, found in zip(methods, zip(*outcomes, strict=True), strict=True):
            for statistic, trimmed in TRIMMED.items():
                value, low, high = mean_over_tasks(found, trimmed, (method, split))
                row = {"row": method, "column": f"{split} {statistic}"}
                row["n"] = min(one.shape[1] for one in found)
                rows.append(row | {"value": 100 * value, "low": 100 * low, "high": 100 * high})
    columns = [f"{split} {statistic}" for split in SPLITS for statistic in TRIMMED]
    frame = pd.DataFrame(rows, columns=["row", "column", "value", "low", "high", "n"])
    return in_order(frame, METHODS, columns)


def _with_all_tasks(results: Results, split: str) -> list[str]:
    """Returns the methods with results on every task."""
    counts = results.main(split=split).groupby("method", sort=False).task.nunique()
    return list(counts.index[counts == len(TASKS)])


def _outcomes(results: Results, methods: Sequence[str], task: str, split: str) -> list[BoolArray]:
    """Returns success (S, N) of each method on a task, on common seeds and starts."""
    if not methods:
        return []
    found = results.paired_success([{"method": m, "task": task, "split": split} for m in methods])
    return [one for one in found if one is not None]


EXHIBIT = Exhibit(
    name="all_tasks",
    title="All tasks together",
    about=(
        "Success [%] over tasks and seeds: the mean, and the interquartile mean, which leaves out"
        " the lowest and the highest quarter; for a method with one fit per task, that drops its"
        " worst and its best task. Intervals are 95%, from a bootstrap that draws seeds and starts"
        " within each task. Not in the paper."
    ),
    table=table,
)
