"""Predicted and tracked motions of each method, from one start of each task."""

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bench.results import Results as StoredResults
from reports.exhibit import Exhibit
from reports.motions import (
    BAND,
    DASHES,
    demonstrated_motion,
    draw_joint,
    most_turning,
    replayed_motion,
)
from reports.pairing import keep_common, without_expert
from reports.results import Results
from reports.style import METHODS, colour, display, ordered
from reports.tables import in_order, table_of
from tasks.errors import InputError
from tasks.registry import TASKS

JOINTS = 2
"""Number of joints shown of a task: those that turn most in the demonstrated motion."""
SEARCHED = 100
"""Number of starts among which to look for the one that is shown."""


def table(results: Results) -> pd.DataFrame:
    """Returns some joints of each method and task over time, from one start of the lowest seed.

    Columns: those of `reports.motions.motions`; ``row`` the method, ``column`` the task, ``value``
    as ``tracked``, ``seed``, ``start``, ``success``, ``seeds`` and ``n``, which are 1; and means
    over all turning joints, ``prediction error`` |predicted - demonstrated| and
    ``tracking error`` |tracked - predicted|.

    Raises:
        InputError: none of the motions can be replayed.
    """
    parts: list[pd.DataFrame] = []
    rows: list[dict[str, Any]] = []
    if isinstance(results.source, StoredResults):
        found = keep_common(without_expert(results.rows.main(split="test")))
        for _, of_task in found.groupby("task", sort=False):
            of_seed = of_task[of_task.seed == of_task.seed.min()]
            rows = of_seed.drop_duplicates("method").to_dict("records")
            parts += _of_task(results, rows)
    if rows and not parts:
        raise InputError("no motion can be replayed; the lines above say why")
    return in_order(pd.concat(parts), METHODS) if parts else table_of()


def _of_task(results: Results, rows: Sequence[dict[str, Any]]) -> list[pd.DataFrame]:
    """Returns the motions of methods on one task. Those that cannot be replayed go to stderr."""
    start = _start_that_divides(results, rows)
    found, demonstrated = [], {}
    for row in rows:
        try:
            if row["demos_key"] not in demonstrated:
                demonstrated[row["demos_key"]] = demonstrated_motion(row, start)
            whole = replayed_motion(results, row, start, demonstrated[row["demos_key"]])
        except InputError as error:
            print(f"bench: no motion of {row['method']} on {row['task']}: {error}", file=sys.stderr)
            continue
        turning = whole[whole.unit == "rad"]
        errors = {
            "prediction error": (turning.predicted - turning.demonstrated).abs().mean(),
            "tracking error": (turning.tracked - turning.predicted).abs().mean(),
        }
        part = whole[whole.joint.isin(most_turning(whole, JOINTS))]
        success = bool(results.outcomes(row).success[start])
        labels = {"row": row["method"], "column": row["task"], "success": success}
        counts = {"seed": row["seed"], "start": start, "seeds": 1, "n": 1}
        found.append(part.assign(value=part.tracked, **labels, **counts, **errors))
    return found


def _start_that_divides(results: Results, rows: Sequence[dict[str, Any]]) -> int:
    """Returns the first start from which as near to half of the methods as possible succeed."""
    success = [results.outcomes(row).success.to_numpy(bool)[:SEARCHED] for row in rows]
    least = min(map(len, success))
    return int(np.abs(np.mean([one[:least] for one in success], axis=0) - 0.5).argmin())


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Returns both errors [rad] of each method on each task."""
    kinds = ["prediction error", "tracking error"]
    each = (
        table.drop(columns="value")
        .drop_duplicates(["row", "column"])
        .melt(["row", "column"], kinds, "kind")
    )
    names = each.row + " " + each.kind
    return in_order(each.assign(row=names), [f"{m} {k}" for m in METHODS for k in kinds])


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a row of panels for each joint, with a column for each method."""
    methods, tasks = ordered(table.row, METHODS), ordered(table.column, TASKS)
    lines = [
        (task, joint) for task in tasks for joint in table[table.column == task].joint.unique()
    ]
    size = (1.9 * len(methods) + 1.4, 1.15 * len(lines) + 0.9)
    drawing = Figure(figsize=size, layout="constrained")
    panels = drawing.subplots(len(lines), len(methods), squeeze=False, sharey="row", sharex=True)
    for line, (task, joint) in zip(panels, lines, strict=True):
        here = table[(table.column == task) & (table.joint == joint)]
        for axes, method in zip(line, methods, strict=True):
            part = here[here.row == method]
            if len(part):
                draw_joint(axes, part, colour(method, methods))
                outcome = "success" if part.success.iloc[0] else "failure"
                axes.set_title(outcome, loc="right", fontsize=7.5, pad=2)
            axes.tick_params(labelsize=8)
        line[0].set_ylim(*_limits(here))
        start = f"seed {here.seed.iloc[0]}, start {here.start.iloc[0]}"
        line[0].set_ylabel(f"{display(task)}\n{start}\n{joint} [rad]", fontsize=7.5)
    for axes, method in zip(panels[0], methods, strict=True):
        axes.set_title(exhibit.display(method), pad=10)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    _add_legend(drawing)
    return drawing


def _add_legend(drawing: Figure) -> None:
    handles = [
        Line2D([], [], color="black", lw=1.0, label="demonstrated"),
        Line2D([], [], color="#666666", lw=1.4, ls=DASHES, label="predicted"),
        Line2D([], [], color="#666666", lw=1.8, label="tracked"),
        Patch(color="#666666", alpha=0.18, lw=0, label=BAND),
    ]
    drawing.legend(handles=handles, frameon=False, loc="outside lower center", ncols=len(handles))


def _limits(part: pd.DataFrame) -> tuple[float, float]:
    """Returns the range of the joint, widened. A wild prediction may leave the panel."""
    seen = part[["demonstrated", "tracked"]]
    low, high = seen.min(axis=None), seen.max(axis=None)
    margin = 0.25 * (high - low) or 1.0
    return low - margin, high + margin


EXHIBIT = Exhibit(
    name="motions",
    title="Predicted and tracked motions",
    about="Figure: the two joints of each task that turn most in the demonstrated motion, from one"
    " start of the lowest seed (their numbers are beside the axis): of the first ones, that which"
    " divides the methods most evenly into success and failure. Demonstrated: by the expert from"
    " that start, or, where methods learnt from other demonstrations, in the one with the nearest"
    " start. Bands: the mean prediction error on validation demonstrations. Table: mean"
    " |predicted - demonstrated| and |tracked - predicted| in this episode, over all joints that"
    " turn [rad].",
    table=table,
    unit="rad",
    digits=3,
    axis="joint [rad]",
    figure=figure,
    summary=summary,
)
