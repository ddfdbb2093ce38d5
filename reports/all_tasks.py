"""Success over all tasks together."""

import pandas as pd

from reports.exhibit import Exhibit, in_order
from reports.results import Results
from reports.stats import mean_over_tasks
from reports.style import METHODS, TASKS

SPLITS = {"test": "unseen", "ood": "out of distribution"}
TRIMMED = {"mean": 0.0, "interquartile mean": 0.25}
"""What stands in a column, and the share of the rates that it leaves out at either end."""


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method that was tried on all tasks, and two columns for each split."""
    rows = []
    for split, place in SPLITS.items():
        for method in results.main(split=split).method.unique():
            outcomes = [results.success(method=method, task=t, split=split) for t in TASKS]
            found = [one for one in outcomes if one is not None]
            if len(found) < len(TASKS):
                continue
            for statistic, trimmed in TRIMMED.items():
                value, low, high = mean_over_tasks(found, trimmed, (method, split))
                row = {"row": method, "column": f"{place}, {statistic}"}
                row["n"] = min(one.shape[1] for one in found)
                rows.append(row | {"value": 100 * value, "low": 100 * low, "high": 100 * high})
    columns = [f"{place}, {statistic}" for place in SPLITS.values() for statistic in TRIMMED]
    frame = pd.DataFrame(rows, columns=["row", "column", "value", "low", "high", "n"])
    return in_order(frame, METHODS, columns)


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
