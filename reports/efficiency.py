"""Sample efficiency: success against the number of demonstrations."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from reports.exhibit import Exhibit, add_legend, errors_of
from reports.results import Results
from reports.style import METHODS, TASKS, colour, display, marker, ordered


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method and number of demonstrations, and a column for each task."""
    found = results.chosen(split="test")
    found = found[(found.method != "expert")]
    if found.empty or found.demos.nunique() < 2:
        return pd.DataFrame(columns=["row", "column", "value"])
    return in_rows(results.rates(found, ["method", "demos", "task"]))


def in_rows(found: pd.DataFrame) -> pd.DataFrame:
    """Returns values by method, demos and task as rows and columns of an exhibit, in order."""
    order = {name: place for place, name in enumerate(ordered(found.method, METHODS))}
    found = found.sort_values(["method", "demos"], key=lambda c: c.map(order).fillna(c))
    label = found.method + " " + found.demos.astype(str)
    return found.assign(row=label).rename(columns={"task": "column"})


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns one panel a task, one line a method, with intervals."""
    drawing = draw_lines(table, exhibit)
    for axes in drawing.axes:
        axes.set_ylim(0, 105)
    return drawing


def draw_lines(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns one panel a task, one line a method, with intervals where there are any."""
    tasks = [task for task in TASKS if task in set(table.column)]
    lines, columns = -(-len(tasks) // 2), min(len(tasks), 2)
    drawing = Figure(figsize=(3.1 * columns + 0.4, 2.2 * lines + 0.6))
    panels = drawing.subplots(lines, columns, sharey=True, squeeze=False).ravel()
    for empty in panels[len(tasks) :]:
        empty.remove()
    methods = table.method.drop_duplicates().tolist()
    counts = sorted(table.demos.unique())
    for axes, task in zip(panels[: len(tasks)], tasks, strict=True):
        for method in methods:
            part = table[(table.column == task) & (table.method == method)]
            axes.errorbar(
                part.demos,
                part.value,
                errors_of(part),
                marker=marker(method, methods),
                ms=4,
                lw=1.2,
                capsize=2,
                color=colour(method, methods),
                label=exhibit.display(method),
            )
        axes.set(xscale="log")
        axes.set_title(display(task), fontsize=10, loc="left")
        axes.set_xticks(counts, _apart(counts), fontsize=9)
        axes.minorticks_off()
    drawing.supxlabel("demonstrations", fontsize=10)
    drawing.supylabel(exhibit.axis, fontsize=10)
    add_legend(drawing, exhibit)
    return drawing


def _apart(counts: Sequence[int]) -> list[str]:
    """The counts as labels, empty where the next one is too near on a logarithmic axis."""
    nexts = [*counts[1:], np.inf]
    return [
        str(count) if later >= 1.4 * count else ""
        for count, later in zip(counts, nexts, strict=True)
    ]


EXHIBIT = Exhibit(
    name="efficiency",
    title="Sample efficiency",
    about="Success [%] on unseen starts against the number of demonstrations.",
    table=table,
    part="data and time",
    figure=figure,
)
