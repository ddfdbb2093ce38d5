"""Training time against the number of demonstrations."""

import pandas as pd
from matplotlib.figure import Figure

from reports.efficiency import draw_lines, in_rows
from reports.exhibit import Exhibit, log_dots, logarithmic
from reports.results import Results


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method and number of demonstrations, and a column for each task."""
    found = results.chosen(split="test").dropna(subset="fit_seconds")
    found = found[found.method != "expert"]
    if found.empty:
        return pd.DataFrame(columns=["row", "column", "value"])
    found = found.drop_duplicates(["method", "demos", "task"])
    table = in_rows(found.rename(columns={"fit_seconds": "value"}))
    return table[["row", "column", "method", "demos", "value"]]


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns one panel a task, one line a method; with one number of demonstrations, dots."""
    if table.demos.nunique() == 1:
        return log_dots(table.assign(row=table.method), exhibit)
    drawing = draw_lines(table, exhibit)
    for axes in drawing.axes:
        logarithmic(axes)
    return drawing


EXHIBIT = Exhibit(
    name="efficiency_time",
    title="Training time",
    about=(
        "Seconds to train one seed on so many demonstrations, one thread, alone on the machine"
        " (bench time): medians of three; of networks, half of what two seeds take together, over"
        " a twentieth of their epochs, which all do the same work."
    ),
    table=table,
    part="data and time",
    unit="",
    digits=2,
    axis="training time [s]",
    figure=figure,
)
