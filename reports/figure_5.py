"""Figure 5: success from starts out of distribution."""

import pandas as pd

from reports.exhibit import Exhibit
from reports.results import Results
from reports.unseen import success_by_method


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method, the expert too, and a column for each task."""
    return success_by_method(results, "ood")


EXHIBIT = Exhibit(
    name="figure_5",
    title="Figure 5: success out of distribution",
    about="Success [%] from starts outside the ranges of training. Published: figure only.",
    table=table,
)
