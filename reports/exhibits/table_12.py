"""Table 12: the largest eigenvalue magnitude of K."""

import numpy as np
import pandas as pd

from reports.charts import dots
from reports.diagnostics import magnitudes
from reports.exhibit import Exhibit
from reports.paper import with_published
from reports.results import Results
from reports.seed_statistics import mean_of


def magnitudes_by_task(results: Results) -> dict[str, np.ndarray]:
    """Returns the eigenvalue magnitudes of each seed's K (R, p) by task, for KODex as described."""
    found = (
        results.rows.main(method="kodex")
        .drop_duplicates("folder")
        .sort_values("seed", kind="stable")
    )
    return {
        str(task): np.array([magnitudes(results, row) for row in mine.to_dict("records")])
        for task, mine in found.groupby("task", sort=False)
    }


def table(results: Results) -> pd.DataFrame:
    """Returns one row, KODex, and a column for each task."""
    rows = []
    for task, values in magnitudes_by_task(results).items():
        largest = values.max(axis=1)
        about = {"value": largest.mean(), "spread": np.nan, "low": np.nan, "high": np.nan}
        if len(largest) > 1:
            found = mean_of(largest)
            about = {"value": found.value, "spread": largest.std(ddof=1)}
            about |= {"low": found.low, "high": found.high, "basis": found.basis}
        rows.append({"row": "kodex", "column": task} | about | {"seeds": len(largest)})
    columns = ["row", "column", "value", "spread", "low", "high", "basis", "seeds"]
    return with_published(pd.DataFrame(rows, columns=columns), "table_12")


EXHIBIT = Exhibit(
    name="table_12",
    title="Table 12: largest eigenvalue magnitude",
    about="Largest magnitude of an eigenvalue of K, mean and standard deviation over seeds; above 1"
    " the linear model is unstable.",
    table=table,
    part="KODex inside",
    unit="",
    digits=5,
    axis="largest magnitude",
    figure=dots,
)
