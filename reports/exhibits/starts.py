"""Where methods fail: starts in their ranges, by success."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from reports.charts import add_marker_legend
from reports.exhibit import Exhibit
from reports.pairing import keep_common
from reports.results import SPLITS, Results
from reports.starts import draw_starts, start_values
from reports.style import METHODS, display, ordered
from reports.tables import in_order, table_of
from tasks.registry import TASKS, task_names

SHOWN = 200
"""Number of starts of a split that are shown: the first ones of each seed, as many of each."""
OUTCOMES: dict[str, dict[str, Any]] = {
    "success": {"color": "#7fa8c9", "marker": "o", "s": 9, "linewidths": 0},
    "failure": {"color": "#c0306a", "marker": "x", "s": 16, "linewidths": 1.1},
}
"""How starts are drawn, by outcome. Points keep their colours on a light and on a dark page."""


def table(results: Results) -> pd.DataFrame:
    """Returns a line for each method, task, split, seed and start, whose ``value`` is 0 or 100 [%].

    Columns: ``split``, ``seed``, ``start`` its index among those of the seed, ``seeds``, ``n``
    starts of each that are shown, and a column for each number of a start.
    """
    from tasks.registry import get_task  # imports MuJoCo

    parts = []
    for split in SPLITS:
        rows = results.rows.main(split=split)
        found = keep_common(rows[rows.task.isin(task_names())])
        if found.empty:
            continue
        seeds = found.groupby(["task", "method"]).seed.transform("nunique")
        few = np.minimum(found.episodes, np.maximum(1, SHOWN // seeds))
        for row in found.assign(seeds=seeds, n=few).to_dict("records"):
            success = results.outcomes(row).success.to_numpy(bool)[: row["n"]]
            values = start_values(get_task(row["task"]), split, row["n"], row["seed"])
            place = {"row": row["method"], "column": row["task"], "split": split}
            facts = {name: row[name] for name in ("seed", "seeds", "n")}
            parts.append(values.assign(**place, **facts, value=100.0 * success))
    if not parts:
        return table_of()
    whole = in_order(pd.concat(parts), METHODS)
    first = ["row", "column", "split", "seed", "start", "value", "seeds", "n"]
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
    marked = table.assign(outcome=np.where(table.value > 0, *OUTCOMES))
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
    about="Figure: the first starts of each split and seed, by outcome; the dashed frame holds the"
    " training distribution. Table: success [%] from these starts, by half of the range of each"
    " number of a start.",
    table=table,
    figure=figure,
    summary=summary,
)
