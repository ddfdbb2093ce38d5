"""When methods reach the goal: the share of episodes that have succeeded, over time."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from reports.exhibit import Exhibit
from reports.pairing import keep_common
from reports.results import Results
from reports.style import METHODS, colour, dashes, display, marker, ordered
from reports.tables import in_order, table_of
from tasks.data import CONTROL_STEP, FloatArray
from tasks.registry import TASKS, task_names


def table(results: Results) -> pd.DataFrame:
    """Returns a line for each method, task and control step: ``value``, the share of episodes [%].

    Columns: ``t`` the time [s], ``value`` the mean over seeds, ``least`` and ``most`` of any seed,
    ``seeds``, ``n`` starts of each.
    """
    parts = []
    rows = results.rows.main(split="test")
    whole = keep_common(rows[rows.task.isin(task_names())])
    for (task, method), found in whole.groupby(["task", "method"], sort=False):
        count = int(found.episodes.min())
        curves = [_curve(results, task, row, count) for row in found.to_dict("records")]
        shares = np.array([100 * curve for curve in curves if curve is not None])
        if len(shares):
            parts.append(
                pd.DataFrame(
                    {
                        "row": method,
                        "column": task,
                        "t": CONTROL_STEP * np.arange(1, shares.shape[1] + 1),
                        "value": shares.mean(axis=0),
                        "least": shares.min(axis=0),
                        "most": shares.max(axis=0),
                        "seeds": len(shares),
                        "n": count,
                    }
                )
            )
    return in_order(pd.concat(parts), METHODS) if parts else table_of()


def _curve(results: Results, name: str, row: dict[str, Any], count: int) -> FloatArray | None:
    """Returns the share (T-1,) of episodes that would have succeeded had they ended at each step.

    Only the first `count` episodes count. None where this needs readings and none are stored.
    """
    from tasks.registry import get_task  # imports MuJoCo

    task = get_task(name)
    outcomes = results.outcomes(row).iloc[:count]
    steps = np.arange(1, task.steps + 1)
    if task.ends_early:
        met = outcomes.success.to_numpy() & (outcomes.steps.to_numpy() <= steps[:, None])
        return np.asarray(met.mean(axis=1))
    stored = results.readings(row)
    if stored is None:
        return None
    readings = stored[:count].astype(np.float64)
    sound = ~outcomes.diverged.to_numpy()
    return np.array([(task.success(readings[:, :step]) & sound).mean() for step in steps])


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Returns when each method reaches half of its final success [s]; NaN where it has none."""
    rows = []
    for (method, task), curve in table.groupby(["row", "column"], sort=False):
        half = curve[curve.value >= curve.value.iloc[-1] / 2]
        time = half.t.iloc[0] if curve.value.iloc[-1] > 0 else np.nan
        rows.append({"row": method, "column": task, "value": time})
    return pd.DataFrame(rows)


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a panel for each task with a line for each method."""
    tasks, methods = ordered(table.column, TASKS), ordered(table.row, METHODS)
    drawing = Figure(figsize=(2.6 * len(tasks) + 1.2, 2.9), layout="constrained")
    panels = drawing.subplots(1, len(tasks), sharey=True, squeeze=False)[0]
    for axes, task in zip(panels, tasks, strict=True):
        for method in methods:
            curve = table[(table.column == task) & (table.row == method)]
            shade = colour(method, methods)
            axes.fill_between(curve.t, curve.least, curve.most, color=shade, alpha=0.15, lw=0)
            axes.plot(
                curve.t,
                curve.value,
                color=shade,
                ls=dashes(method, methods),
                lw=1.8,
                marker=marker(method, methods),
                markevery=(0.04, 0.17),
                ms=4,
                label=exhibit.display(method),
            )
        axes.set(title=display(task), xlabel="time [s]", ylim=(-2, 104), xlim=(0, None))
        axes.xaxis.set_major_locator(MultipleLocator(0.25))
        axes.xaxis.set_major_formatter("{x:g}")
    panels[0].set_ylabel(exhibit.axis)
    handles, labels = panels[0].get_legend_handles_labels()
    drawing.legend(handles, labels, frameon=False, loc="outside right upper", handlelength=3.2)
    return drawing


EXHIBIT = Exhibit(
    name="success_over_time",
    title="Success over time",
    about="Figure: the share of episodes from test starts that would have succeeded had they ended"
    " at that time; bands reach from the lowest seed to the highest. On tasks that are judged at"
    " the last step alone (Tool, Door), the share can fall again; where steps are counted"
    " (Relocation, Reorientation), success stays once reached. The former are missing where"
    " readings are not stored, as in packed results. Table: when a method reaches half of its final"
    " success [s].",
    table=table,
    unit="s",
    digits=2,
    axis="succeeded [%]",
    figure=figure,
    summary=summary,
)
