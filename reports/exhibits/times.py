"""What a method costs: the time to train it, and the time that it takes for an action."""

import pandas as pd

from reports.exhibit import Exhibit
from reports.pairing import without_expert
from reports.results import Results
from reports.style import METHODS
from reports.tables import in_order, table_of

FIT, ACTION = "training [s]", "action [ms]"


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method: means over the tasks on which all methods were timed."""
    found = without_expert(results.rows.of_all(split="test")).dropna(subset="action_seconds")
    timed = found.drop_duplicates(["method", "task"]).set_index(["task", "method"])
    seconds = timed[["fit_seconds", "action_seconds"]].unstack()
    means = seconds.dropna().mean().unstack(0)
    if means.empty:
        return table_of()
    shown = pd.DataFrame({FIT: means.fit_seconds, ACTION: 1e3 * means.action_seconds})
    rows = shown.rename_axis("row").reset_index().melt("row", var_name="column")
    return in_order(rows, METHODS, (FIT, ACTION))


EXHIBIT = Exhibit(
    name="times",
    title="Training time and time per action",
    about="CPU time on one thread, alone on the machine (bench time), the mean over tasks: to train"
    " one seed, and to answer one control step of one episode. A motion is predicted once, and its"
    " time is shared by all steps; the controller's is left out.",
    table=table,
    part="data and time",
    unit="",
    digits=3,
    axis="",
)
