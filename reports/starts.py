"""Starts as data frames and as points in their ranges."""

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

if TYPE_CHECKING:
    from tasks.base import Task


def start_values(task: "Task", split: str, n: int) -> pd.DataFrame:
    """Returns the index ``start`` and the numbers, in their units, of a split's first n starts."""
    names = [component.name for component in task.start_components]
    starts = task.sample(split, n)
    return pd.DataFrame(starts.values, columns=names).assign(start=starts.index)


def draw_starts(
    axes: Axes, task: "Task", starts: pd.DataFrame, looks: dict[str, dict[str, Any]]
) -> None:
    """Draws starts as points, and a frame around those in distribution.

    Args:
        axes: gets the points. Their coordinates are those of `shown_numbers`.
        task: of the starts.
        starts: ``start``, ``outcome`` and a column for each number of a start.
        looks: arguments of `Axes.scatter` by outcome. Later outcomes cover earlier ones.
    """
    x, *second = shown_numbers(task)
    components, box = task.start_components, task.in_distribution
    (y,) = second or (None,)
    for outcome, look in looks.items():
        part = starts[starts.outcome == outcome]
        height = part.start if y is None else part[components[y].name]
        axes.scatter(part[components[x].name], height, rasterized=True, **look)
    low, high = (0, max(starts.start, default=0)) if y is None else (box.low[y], box.high[y])
    place, width = (box.low[x], low), box.high[x] - box.low[x]
    axes.add_patch(
        Rectangle(place, width, high - low, fill=False, ec="#666666", lw=0.9, ls="--", zorder=0)
    )
    axes.set_xlabel(_label(task, x))
    axes.set_ylabel("start" if y is None else _label(task, y))
    axes.grid(visible=False)


def shown_numbers(task: "Task") -> list[int]:
    """Returns the places of the one or two numbers of a start that say most of where it lies.

    Numbers that go beyond the training range out of distribution come first, then those of the
    widest range.
    """
    low, high = np.array(task.in_distribution.low), np.array(task.in_distribution.high)
    boxes = task.out_of_distribution
    leaves = np.any([(np.array(b.low) < low) | (np.array(b.high) > high) for b in boxes], axis=0)
    order = sorted(range(len(low)), key=lambda place: (not leaves[place], low[place] - high[place]))
    return sorted(order[:2])


def _label(task: "Task", place: int) -> str:
    component = task.start_components[place]
    return f"{component.name.replace('_', ' ')} [{component.unit}]"
