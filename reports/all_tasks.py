"""Success over all tasks together, as the interquartile mean."""

import pandas as pd

from reports.exhibit import Exhibit, in_order
from reports.results import Results
from reports.stats import interquartile_mean
from reports.style import METHODS, TASKS

SPLITS = {"test": "unseen", "ood": "out of distribution"}


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method that was tried on all tasks, and a column for each split."""
    rows = []
    for split, column in SPLITS.items():
        for method in results.main(split=split).method.unique():
            outcomes = [results.success(method=method, task=t, split=split) for t in TASKS]
            found = [one for one in outcomes if one is not None]
            if len(found) == len(TASKS):
                value, low, high = interquartile_mean(found, (method, split))
                row = {"row": method, "column": column, "n": min(one.shape[1] for one in found)}
                rows.append(row | {"value": 100 * value, "low": 100 * low, "high": 100 * high})
    columns = ["row", "column", "value", "low", "high", "n"]
    return in_order(pd.DataFrame(rows, columns=columns), METHODS, list(SPLITS.values()))


EXHIBIT = Exhibit(
    name="all_tasks",
    title="All tasks together",
    about=(
        "Interquartile mean of success [%] over tasks and seeds: the mean of their middle half."
        " Intervals are 95%, of a bootstrap that draws seeds and episodes within each task."
        " Published: nothing of the kind."
    ),
    table=table,
)
