"""Where each method fails: starts in their ranges, by success."""

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from reports.exhibit import Exhibit, in_order
from reports.results import Results
from reports.style import METHODS, TASKS, display, ordered

if TYPE_CHECKING:
    from tasks.base import Task

SHOWN = 200
"""Starts of a split that are shown, the first ones."""
SPLITS = ("test", "ood")
OUTCOMES: dict[str, dict[str, Any]] = {
    "every seed succeeds": {"color": "#7fa8c9", "marker": "o", "s": 9, "linewidths": 0},
    "some seeds succeed": {"color": "#c96a00", "marker": "^", "s": 16, "linewidths": 0},
    "every seed fails": {"color": "#c0306a", "marker": "x", "s": 16, "linewidths": 1.1},
}
"""How starts are drawn, legible on a light and on a dark page: points keep their colour on both."""


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method, task, split and start: ``value``, the share of seeds [%].

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
        return pd.DataFrame(columns=["row", "column", "value"])
    whole = in_order(pd.concat(parts), METHODS)
    first = ["row", "column", "split", "start", "value", "seeds", "n"]
    return whole[[*first, *whole.columns.difference(first, sort=False)]]


def start_values(task: "Task", split: str, n: int) -> pd.DataFrame:
    """Returns ``start`` and the numbers of the first n starts of a split, each in its unit."""
    names = [component.name for component in task.start_components]
    starts = task.sample(split, n)
    return pd.DataFrame(starts.values, columns=names).assign(start=starts.index)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Returns success [%] by half of the range of each number, and out of distribution."""
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
        parts.append(outside.assign(place=f"{task} out of distribution"))
    whole = pd.concat([part for part in parts if len(part)])
    means = whole.groupby(["place", "row"], sort=False).value.mean().reset_index()
    return means.rename(columns={"place": "row", "row": "column"})


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a row of panels for each method, a column for each task."""
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
    handles = [panels[0, 0].scatter([], [], label=name, **how) for name, how in OUTCOMES.items()]
    drawing.legend(handles=handles, frameon=False, loc="outside lower center", ncols=len(handles))
    return drawing


def draw_starts(
    axes: Axes, task: "Task", starts: pd.DataFrame, looks: dict[str, dict[str, Any]]
) -> None:
    """Draws starts at two of their numbers, and a frame around those in distribution.

    Args:
        axes: gets them.
        task: whose starts they are.
        starts: a column for each number, ``start`` and ``outcome``.
        looks: by outcome, how `Axes.scatter` draws it, one over the other.
    """
    x, *second = shown_numbers(task)
    components, box = task.start_components, task.in_distribution
    (y,) = second or (None,)
    for outcome, how in looks.items():
        part = starts[starts.outcome == outcome]
        height = part.start if y is None else part[components[y].name]
        axes.scatter(part[components[x].name], height, rasterized=True, **how)
    low, high = (0, max(starts.start, default=0)) if y is None else (box.low[y], box.high[y])
    place, width = (box.low[x], low), box.high[x] - box.low[x]
    axes.add_patch(
        Rectangle(place, width, high - low, fill=False, ec="#666666", lw=0.9, ls="--", zorder=0)
    )
    axes.set_xlabel(_label(task, x))
    axes.set_ylabel("start" if y is None else _label(task, y))
    axes.grid(visible=False)


def shown_numbers(task: "Task") -> list[int]:
    """Returns which one or two numbers of a start say most of where it lies.

    Those that leave the range of training out of distribution come first, then those of the widest
    range.
    """
    low, high = np.array(task.in_distribution.low), np.array(task.in_distribution.high)
    boxes = task.out_of_distribution
    leaves = np.any([(np.array(b.low) < low) | (np.array(b.high) > high) for b in boxes], axis=0)
    order = sorted(range(len(low)), key=lambda place: (not leaves[place], low[place] - high[place]))
    return sorted(order[:2])


def _label(task: "Task", place: int) -> str:
    component = task.start_components[place]
    return f"{component.name.replace('_', ' ')} [{component.unit}]"


EXHIBIT = Exhibit(
    name="starts",
    title="Where methods fail",
    about="Figure: the first starts of each split, by how many seeds succeed from there; the dashed"
    " frame holds those of the training distribution. Table: success [%] by half of the range of"
    " each number of a start.",
    table=table,
    figure=figure,
    summary=summary,
)
