"""Sample efficiency: success by number of demonstrations."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from reports.charts import add_legend, add_line, task_panels
from reports.exhibit import Exhibit
from reports.pairing import without_expert
from reports.results import Results
from reports.style import METHODS, ordered
from reports.tables import in_order, table_of
from tasks.registry import TASKS

BESIDE = 1.015
"""Distance of a method from the next, as a factor, on the logarithmic x-axis."""


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method and number of demonstrations, and a column for each task."""
    given = given_in_all(without_expert(results.rows.select(split="test")))
    parts = [part for _, part in given.groupby("demos")]
    found = pd.concat(results.rows.at_one_size(parts)) if parts else given
    found = found[found.groupby("task").demos.transform("nunique") > 1]
    if found.empty:
        return table_of()
    return by_demos(results.episodes.rates(found, ["method", "demos", "task"]))


def given_in_all(found: pd.DataFrame) -> pd.DataFrame:
    """Returns the evaluations with ``demos`` the number of demonstrations a method has in all.

    A method that holds some out for validation is shown by those fits alone.
    """
    holds_out = found.groupby("method").held_out.transform("max") > 0
    kept = found[~holds_out | (found.held_out > 0)]
    return kept.assign(demos=kept.demos + kept.held_out)


def by_demos(found: pd.DataFrame) -> pd.DataFrame:
    """Returns values of methods, demos and tasks as rows "method demos" and columns "task"."""
    label = found.method + " " + found.demos.astype(str)
    rows = [f"{m} {n}" for m in ordered(found.method, METHODS) for n in sorted(set(found.demos))]
    return in_order(found.assign(row=label).rename(columns={"task": "column"}), rows)


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a panel for each task with a line and intervals for each method."""
    drawing = draw_lines(table, exhibit)
    for axes in drawing.axes:
        axes.set_ylim(0, 105)
    return drawing


def draw_lines(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a panel for each task with a line for each method, and intervals if there are any."""
    tasks = ordered(table.column, TASKS)
    drawing, panels = task_panels(tasks, (3.1, 2.2), (0.4, 0.6))
    methods = table.method.drop_duplicates().tolist()
    counts = sorted(table.demos.unique())
    for task, axes in panels.items():
        for place, method in enumerate(methods):
            part = table[(table.column == task) & (table.method == method)]
            x = part.demos * BESIDE ** (place - (len(methods) - 1) / 2)
            add_line(axes, x, part, method, methods, exhibit)
        axes.set(xscale="log")
        axes.set_xticks(counts, _tick_labels(counts), fontsize=9)
        axes.minorticks_off()
    drawing.supxlabel("demonstrations", fontsize=10)
    drawing.supylabel(exhibit.axis, fontsize=10)
    add_legend(drawing, exhibit)
    return drawing


def _tick_labels(counts: Sequence[int]) -> list[str]:
    """Returns the counts as text, empty where the next one is too near on a logarithmic axis."""
    nexts = [*counts[1:], np.inf]
    return [
        str(count) if later >= 1.4 * count else ""
        for count, later in zip(counts, nexts, strict=True)
    ]


EXHIBIT = Exhibit(
    name="efficiency",
    title="Sample efficiency",
    about="Success [%] on test starts by number of demonstrations.",
    table=table,
    part="data and time",
    figure=figure,
)
