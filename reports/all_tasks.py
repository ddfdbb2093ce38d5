"""Success over all tasks together."""

from collections.abc import Sequence

import pandas as pd

from reports.exhibit import Exhibit, in_order
from reports.results import Results
from reports.stats import mean_over_tasks
from reports.style import METHODS, TASKS
from tasks.data import BoolArray

SPLITS = {"test": "unseen", "ood": "out of distribution"}
TRIMMED = {"mean": 0.0, "interquartile mean": 0.25}
"""What stands in a column, and the share of the rates that it leaves out at either end."""


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method that was tried on all tasks, and two columns for each split."""
    rows = []
    for split, place in SPLITS.items():
        everywhere = _on_all_tasks(results, split)
        if not everywhere:
            continue
        outcomes = [_outcomes(results, everywhere, task, split) for task in TASKS]
        for method, found in zip(everywhere, zip(*outcomes, strict=True), strict=True):
            for statistic, trimmed in TRIMMED.items():
                value, low, high = mean_over_tasks(found, trimmed, (method, split))
                row = {"row": method, "column": f"{place}, {statistic}"}
                row["n"] = min(one.shape[1] for one in found)
                rows.append(row | {"value": 100 * value, "low": 100 * low, "high": 100 * high})
    columns = [f"{place}, {statistic}" for place in SPLITS.values() for statistic in TRIMMED]
    frame = pd.DataFrame(rows, columns=["row", "column", "value", "low", "high", "n"])
    return in_order(frame, METHODS, columns)


def _on_all_tasks(results: Results, split: str) -> list[str]:
    """The methods that were tried on every task."""
    counts = results.main(split=split).groupby("method", sort=False).task.nunique()
    return list(counts.index[counts == len(TASKS)])


def _outcomes(results: Results, methods: Sequence[str], task: str, split: str) -> list[BoolArray]:
    """(S, N) success of each method on a task, on common seeds and starts."""
    found = results.successes([{"method": m, "task": task, "split": split} for m in methods])
    return [one for one in found if one is not None]


EXHIBIT = Exhibit(
    name="all_tasks",
    title="All tasks together",
    about=(
        "Success [%] over tasks and seeds: the mean, and the interquartile mean, which leaves out"
        " the lowest and the highest quarter; of a method with a single fit for each task, these"
        " are its worst and its best task. Intervals are 95%, of a bootstrap that draws seeds and"
        " starts within each task. Published: nothing of the kind."
    ),
    table=table,
)
