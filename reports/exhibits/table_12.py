"""Table 12: the largest eigenvalue magnitude of K."""

import numpy as np
import pandas as pd

from reports.charts import dots
from reports.exhibit import Exhibit
from reports.paper import with_published
from reports.results import Results
from reports.tables import table_of


def magnitudes(results: Results) -> dict[str, np.ndarray]:
    """Returns the eigenvalue magnitudes of K (p,) by task, for KODex as described."""
    found = results.main(method="kodex").drop_duplicates("task")
    return {row.task: np.hypot(*results.eigenvalues(row.folder).T) for row in found.itertuples()}


def table(results: Results) -> pd.DataFrame:
    """Returns one row, KODex, and a column for each task."""
    rows = [
        {"row": "kodex", "column": task, "value": float(values.max())}
        for task, values in magnitudes(results).items()
    ]
    return with_published(table_of(rows), "table_12")


EXHIBIT = Exhibit(
    name="table_12",
    title="Table 12: largest eigenvalue magnitude",
    about="Largest magnitude of an eigenvalue of K; above 1 the linear model is unstable.",
    table=table,
    part="KODex inside",
    unit="",
    digits=5,
    axis="largest magnitude",
    figure=dots,
)
