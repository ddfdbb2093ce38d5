"""Success from unseen starts of the training distribution, the paper's main comparison."""

import pandas as pd

from reports.exhibit import Exhibit, in_order, success_table
from reports.results import Results
from reports.style import METHODS


def success_by_method(results: Results, split: str) -> pd.DataFrame:
    """Returns success [%] on a split: a row for each method, a column for each task."""
    return in_order(success_table(results, results.main(split=split), "method", "task"), METHODS)


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method, the expert too, and a column for each task."""
    return success_by_method(results, "test")


EXHIBIT = Exhibit(
    name="unseen",
    title="Success on unseen starts",
    about="Success [%] from unseen starts of the training distribution. Published: figure only.",
    table=table,
)
