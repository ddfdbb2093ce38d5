"""Where methods fail: starts in their ranges, by success."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from reports.charts import add_marker_legend
from reports.exhibit import Exhibit
from reports.results import SPLITS, Results
from reports.starts import draw_starts, start_values
from reports.style import METHODS, TASKS, display, ordered
from reports.tables import in_order, table_of

SHOWN = 200
"""Number of starts of a split that are shown, the first ones."""
OUTCOMES: dict[str, dict[str, Any]] = {
    "every seed succeeds": {"color": "#7fa8c9", "marker": "o", "s": 9, "linewidths": 0},
    "some seeds succeed": {"color": "#c96a00", "marker": "^", "s": 16, "linewidths": 0},
    "every seed fails": {"color": "#c0306a", "marker": "x", "s": 16, "linewidths": 1.1},
}
"""How starts are drawn, by outcome. Points keep their colours on a light and on a dark page."""


def table(results: Results) -> pd.DataFrame:
    """Returns a line for each method, task, split and start: ``value``, the share of seeds [%].

    Columns: ``split``, ``start`` its index, ``seeds``, ``n`` starts of the split that are shown,
    and a column for each number of a start.
    """
    from tasks.registry import get_task  # imports MuJoCo

    parts = []
    for split in SPLITS:
        found = results.main(split=split)
        for task, method in found[["task", "method"]].drop_duplicates().to_numpy():
            success = results.success(task=task, method=method, split=split)
            assert success is not None
            success = success[:, :SHOWN]
            values = start_values(get_task(task), split, success.shape[1])
            facts = {"split": split, "value": 100 * success.mean(axis=0), "seeds": len(success)}
            parts.append(values.assign(row=method, column=task, n=success.shape[1], **facts))
    if not parts:
        return table_of()
    whole = in_order(pd.concat(parts), METHODS)
    first = ["row", "column", "split", "start", "value", "seeds", "n"]
    return whole[[*first, *whole.columns.difference(first, sort=False)]]


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Returns success [%] in each half of the range of each number, and out of distribution."""
    from tasks.registry import get_task  # imports MuJoCo

    parts = []
    for task in table.column.unique():
        mine = table[table.column == task]
        box = get_task(task).in_distribution
        inside, outside = (mine[mine.split == split] for split in SPLITS)
        for place, component in enumerate(get_task(task).start_components):
            high = inside[component.name] > (box.low[place] + box.high[place]) / 2
            for name, half in (("low half", inside[~high]), ("high half", inside[high])):
                number = component.name.removeprefix(f"{task}_")
                parts.append(half.assign(place=f"{task} {number}, {name}"))
        parts.append(outside.assign(place=f"{task} ood"))
    whole = pd.concat([part for part in parts if len(part)])
    means = whole.groupby(["place", "row"], sort=False).value.mean().reset_index()
    return means.rename(columns={"place": "row", "row": "column"})


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a row of panels for each method, with a column for each task."""
    from tasks.registry import get_task  # imports MuJoCo

    methods, tasks = ordered(table.row, METHODS), ordered(table.column, TASKS)
    size = (2.4 * len(tasks) + 0.5, 1.75 * len(methods) + 0.6)
    drawing = Figure(figsize=size, layout="constrained")
    panels = drawing.subplots(len(methods), len(tasks), squeeze=False, sharex="col", sharey="col")
    outcome = np.select([table.value == 100, table.value > 0], [*OUTCOMES][:2], [*OUTCOMES][2])
    marked = table.assign(outcome=outcome)
    for line, method in zip(panels, methods, strict=True):
        for axes, name in zip(line, tasks, strict=True):
            part = marked[(marked.row == method) & (marked.column == name)]
            draw_starts(axes, get_task(name), part, OUTCOMES)
            axes.tick_params(labelsize=7.5)
            axes.yaxis.label.set_size(8)
            axes.xaxis.label.set_visible(line[0] is panels[-1, 0])
        line[0].annotate(
            exhibit.display(method),
            (0, 0.5),
            (-50, 0),
            xycoords="axes fraction",
            textcoords="offset points",
            rotation=90,
            va="center",
            ha="center",
            fontweight="bold",
        )
    for axes, name in zip(panels[0], tasks, strict=True):
        axes.set_title(display(name))
    add_marker_legend(drawing, OUTCOMES)
    return drawing


EXHIBIT = Exhibit(
    name="starts",
    title="Where methods fail",
    about="Figure: the first starts of each split, by how many seeds succeed; the dashed frame"
    " holds the training distribution. Table: success [%] by half of the range of each number of a"
    " start.",
    table=table,
    figure=figure,
    summary=summary,
)
