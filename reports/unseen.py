"""Success from unseen starts of the training distribution, the paper's main comparison."""

import pandas as pd

from reports.exhibit import Exhibit, success_table
from reports.results import Results
from reports.style import METHODS, TASKS, ordered


def success_by_method(results: Results, split: str) -> pd.DataFrame:
    """Returns success [%] on a split: a row for each method, a column for each task."""
    found = success_table(results.main(split=split), "method", "task")
    rows = {name: place for place, name in enumerate(ordered(found.row, METHODS))}
    columns = {name: place for place, name in enumerate(TASKS)}
    order = found.assign(a=found.row.map(rows), b=found.column.map(columns))
    return order.sort_values(["a", "b"]).drop(columns=["a", "b"])


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method, the expert too, and a column for each task."""
    return success_by_method(results, "test")


EXHIBIT = Exhibit(
    name="unseen",
    title="Success on unseen starts",
    about="Success [%] from unseen starts of the training distribution. Published: figure only.",
    table=table,
)
