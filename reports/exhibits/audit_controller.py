"""Audit of the controller: success with controllers that differ in their random numbers alone."""

import pandas as pd

from bench.controller_kinds import ORIGINAL, RESEEDED
from reports.charts import panels
from reports.exhibit import Exhibit
from reports.results import Results
from reports.style import METHODS, TASKS
from reports.tables import in_order, success_table, table_of


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each task and method, and a column for each controller and their mean.

    All columns have the same fits and starts.
    """
    others = pd.concat([results.main(controller=name, split="test") for name in RESEEDED.values()])
    if others.empty:
        return table_of()
    original = results.main(controller=ORIGINAL, split="test")
    found = pd.concat([original[original.folder.isin(others.folder)], others])
    found = found.assign(label=found.method + " " + found.task)
    success = success_table(results, found, "label", "controller")
    rows = [f"{method} {task}" for task in TASKS for method in METHODS[1:]]
    return in_order(_with_mean(success), rows, (ORIGINAL, *RESEEDED.values(), "mean"))


def _with_mean(success: pd.DataFrame) -> pd.DataFrame:
    """Adds the mean and the standard deviation of each row over controllers."""
    values = success.groupby("row").value
    mean = pd.DataFrame({"value": values.mean(), "spread": values.std(ddof=0)})
    return pd.concat([success, mean.reset_index().assign(column="mean")])


EXHIBIT = Exhibit(
    name="audit_controller",
    title="Audit of the controller: other random numbers",
    about=(
        "Success [%] on test starts with the original controller, and with four that were trained"
        " on the same demonstrations with other random numbers. Mean: ± is over controllers."
    ),
    table=table,
    part="audit",
    figure=panels,
)
