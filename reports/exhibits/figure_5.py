"""Figure 5: success out of distribution."""

import pandas as pd

from reports.exhibit import Exhibit
from reports.exhibits.success import success_by_method
from reports.results import Results


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method and the expert, and a column for each task."""
    return success_by_method(results, "ood")


EXHIBIT = Exhibit(
    name="figure_5",
    title="Figure 5: success out of distribution",
    about="Success [%] from starts outside the ranges of training."
    " The paper has a figure without numbers.",
    table=table,
)
