"""Training time by number of demonstrations."""

import pandas as pd
from matplotlib.figure import Figure

from reports.charts import log_dots, set_logarithmic
from reports.exhibit import Exhibit
from reports.exhibits.efficiency import by_demos, draw_lines, given_in_all
from reports.pairing import without_expert
from reports.results import Results
from reports.tables import table_of


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method and number of demonstrations, and a column for each task."""
    timed = without_expert(results.rows.chosen(split="test")).dropna(subset="fit_seconds")
    found = given_in_all(timed)
    if found.empty:
        return table_of()
    found = found.drop_duplicates(["method", "demos", "task"])
    table = by_demos(found.rename(columns={"fit_seconds": "value"}))
    return table[["row", "column", "method", "demos", "value"]]


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a panel for each task with a line for each method. Dots if demos do not vary."""
    if table.demos.nunique() == 1:
        return log_dots(table.assign(row=table.method), exhibit)
    drawing = draw_lines(table, exhibit)
    for axes in drawing.axes:
        set_logarithmic(axes)
    return drawing


EXHIBIT = Exhibit(
    name="efficiency_time",
    title="Training time",
    about=(
        "Seconds to train one seed on so many demonstrations, on one thread, alone on the machine"
        " (bench time): the median of three. Networks: extrapolated from a twentieth of their"
        " epochs, which all take equally long."
    ),
    table=table,
    part="data and time",
    unit="",
    digits=2,
    axis="training time [s]",
    figure=figure,
)
