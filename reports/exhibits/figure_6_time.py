"""Figure 6, left: training time by set of observables."""

import pandas as pd

from reports.charts import log_dots
from reports.exhibit import Exhibit
from reports.exhibits.table_11 import SETS
from reports.results import Results
from reports.tables import table_of


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each set and a column for each task: seconds to fit K."""
    rows = [
        {"row": name, "column": one.task, "value": one.fit_seconds}
        for variant, name in SETS.items()
        for one in results.rows.main(method="kodex", variant=variant)
        .dropna(subset="fit_seconds")
        .drop_duplicates("task")
        .itertuples()
    ]
    return table_of(rows)


EXHIBIT = Exhibit(
    name="figure_6_time",
    title="Figure 6, left: fit time by choice of observables",
    about=(
        "Seconds to fit K, lifting included: the median of three fits on one thread, alone on the"
        " machine (bench time). The paper has a figure without numbers."
    ),
    table=table,
    part="KODex inside",
    unit="",
    digits=2,
    axis="fit time [s]",
    figure=log_dots,
    subjects=("kodex",),
)
