"""Success from test starts, the paper's main comparison."""

import pandas as pd

from reports.exhibit import Exhibit
from reports.results import Results
from reports.style import METHODS
from reports.tables import in_order, success_table


def success_by_method(results: Results, split: str) -> pd.DataFrame:
    """Returns success [%] on a split: a row for each method, a column for each task."""
    return in_order(success_table(results, results.main(split=split), "method", "task"), METHODS)


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method and the expert, and a column for each task."""
    return success_by_method(results, "test")


EXHIBIT = Exhibit(
    name="success",
    title="Success on test starts",
    about="Success [%] from test starts, which are unseen and in distribution. Published: figure"
    " only.",
    table=table,
)
