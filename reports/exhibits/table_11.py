"""Table 11: the number of observables in each set."""

import pandas as pd

from reports.diagnostics import magnitudes
from reports.exhibit import Exhibit
from reports.paper import with_published
from reports.results import Results
from reports.tables import table_of

SETS = {"set_1": "set 1", "set_2": "set 2", "described": "set 3", "set_4": "set 4"}
"""Names of the sets of observables, by variant of KODex."""


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each set and a column for each task."""
    rows = []
    for variant, name in SETS.items():
        fits = results.rows.main(method="kodex", variant=variant).drop_duplicates("task")
        for fit in fits.to_dict("records"):
            count = len(magnitudes(results, fit)) - bool(fit["config"].get("constant"))
            rows.append({"row": name, "column": fit["task"], "value": float(count)})
    table = table_of(rows)
    return with_published(table, "table_11")


EXHIBIT = Exhibit(
    name="table_11",
    title="Table 11: number of observables",
    about="Dimension of the lifted state, as fitted, without the constant.",
    table=table,
    part="KODex inside",
    unit="",
    digits=0,
    axis="observables",
    subjects=("kodex",),
)
