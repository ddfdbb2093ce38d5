"""Predicted, tracked and demonstrated joints over time, from one start."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bench.labels import EXPERT
from bench.results import Results as StoredResults
from reports.exhibit import Exhibit, in_order
from reports.failing import evaluations
from reports.results import Results
from reports.style import METHODS, TASKS, colour, display, ordered
from tasks.data import CONTROL_STEP, FloatArray
from tasks.errors import InputError, unknown_name

PREDICTED = (0, (3, 1.2))
"""Dashes of what was predicted."""
BAND = "mean prediction error"
JOINTS = 2
"""Joints of a task that the exhibit shows: those that the demonstrated motion turns most."""
COMPARED = 100
"""Starts among which the exhibit looks for one that tells the methods apart."""


def motions(
    folder: Path, task: str, method: str, start: int, seed: int | None = None
) -> pd.DataFrame:
    """Returns where the hand's joints were to be, and were, in one stored episode of ``test``.

    One row for each joint and time, columns: ``t`` [s], ``joint``, ``predicted`` by the method
    (NaN where it acts in closed loop), ``tracked`` in the episode (NaN once it has diverged),
    ``demonstrated`` by the suite's expert from the same start, or, where the fit learnt from other
    demonstrations, in that of the nearest start; ``error``, the mean |predicted - demonstrated|
    of the fit over validation demonstrations and time; ``unit``, rad or m, of all of these.

    Args:
        folder: results of `bench run`.
        task: name of a task.
        method: name of a method.
        start: index of a start of ``test`` that was evaluated.
        seed: of the fit. Default: the lowest.

    Raises:
        InputError: there is no such task, method, seed or start; the folder holds packed results,
            without fits; or see `bench.replay.replay`.
    """
    results = Results(folder)
    if not isinstance(results.source, StoredResults):
        raise InputError(f"{folder} holds packed results, without the fits that motions need")
    row = evaluations(results, task, method, "test", seed)[0]
    return _motions(results, row, start, _demonstrated(row, start))


def _motions(
    results: Results, row: Mapping[str, Any], start: int, demonstrated: FloatArray
) -> pd.DataFrame:
    from bench.replay import replay  # imports torch
    from tasks.registry import get_task

    task = get_task(row["task"])
    seen = replay(results.folder, row, [start], whole=True)
    tracked = seen.joints[0]
    nothing = np.full_like(tracked, np.nan)
    predicted = nothing if seen.planned is None else seen.planned[0]
    error = results.diagnostics(row["folder"]).get("imitation_error", nothing[0])
    joints = task.components[: task.robot_dim]
    times = CONTROL_STEP * np.arange(len(tracked))
    shown = (tracked, predicted, demonstrated)
    columns = dict(zip(("tracked", "predicted", "demonstrated"), shown, strict=True))
    parts = [
        pd.DataFrame({"t": times, "joint": joint.name})
        .assign(**{name: values[:, place] for name, values in columns.items()})
        .assign(error=float(error[place]), unit=joint.unit)
        for place, joint in enumerate(joints)
    ]
    order = ["t", "joint", "predicted", "tracked", "demonstrated", "error", "unit"]
    return pd.concat(parts, ignore_index=True)[order]


def _demonstrated(row: Mapping[str, Any], start: int) -> FloatArray:
    """What a fit was to imitate from a start of ``test``, (T, H)."""
    from tasks.demos import demos_key, load_demos
    from tasks.experts import load_expert
    from tasks.recorder import record
    from tasks.registry import get_task

    task = get_task(row["task"])
    here = task.sample("test", start + 1)[start:]
    if row["method"] == EXPERT or row["demos_key"] == demos_key(task):
        shown = record(task, here, load_expert(task).policy, failures=True)[1]
    else:
        demos = load_demos(task, row["demos_key"])
        width = np.subtract(task.in_distribution.high, task.in_distribution.low)
        away = np.linalg.norm((demos.starts.values - here.values) / width, axis=1)
        shown = demos[np.array([away.argmin()])]
    if not len(shown):  # it diverged
        return np.full((task.horizon, task.robot_dim), np.nan)
    return shown.states[0, :, : task.robot_dim]


def draw_motion(frame: pd.DataFrame, joints: Sequence[str] | None = None) -> Figure:
    """Returns one panel for each joint: predicted, tracked and demonstrated over time.

    Args:
        frame: as `motions` returns it.
        joints: names. Default: the three that the demonstrated motion turns most.

    Raises:
        InputError: there is no such joint.
    """
    known = frame.joint.unique().tolist()
    chosen = list(joints) if joints else telling(frame, 3)
    for joint in chosen:
        if joint not in known:
            raise unknown_name("joint", joint, known)
    drawing = Figure(figsize=(6.4, 1.7 * len(chosen) + 0.6), layout="constrained")
    panels = drawing.subplots(len(chosen), sharex=True, squeeze=False)[:, 0]
    for axes, joint in zip(panels, chosen, strict=True):
        part = frame[frame.joint == joint]
        _draw(axes, part, "#0173b2")
        axes.set_ylabel(f"{joint} [{part.unit.iloc[0]}]")
    panels[-1].set_xlabel("time [s]")
    handles, labels = panels[0].get_legend_handles_labels()
    drawing.legend(handles, labels, frameon=False, loc="outside upper center", ncols=len(labels))
    return drawing


def _draw(axes: Axes, part: pd.DataFrame, shade: str) -> None:
    """Draws one joint of one episode."""
    axes.plot(part.t, part.demonstrated, color="black", lw=1.0, label="demonstrated")
    if part.predicted.notna().any():
        low, high = part.predicted - part.error, part.predicted + part.error
        axes.fill_between(part.t, low, high, color=shade, alpha=0.18, lw=0, label=BAND)
        axes.plot(part.t, part.predicted, color=shade, lw=1.4, ls=PREDICTED, label="predicted")
    axes.plot(part.t, part.tracked, color=shade, lw=1.8, label="tracked")


def telling(frame: pd.DataFrame, count: int) -> list[str]:
    """Returns the joints [rad] that the demonstrated motion turns most, in the hand's order."""
    turning = frame[frame.unit == "rad"].groupby("joint", sort=False).demonstrated
    reach = (turning.max() - turning.min()).nlargest(count)
    return [joint for joint in frame.joint.unique() if joint in reach.index]


def table(results: Results) -> pd.DataFrame:
    """Returns the telling joints of each method and task: the lowest seed, one start a task.

    Columns: those of `motions`; ``row`` the method, ``column`` the task, ``value`` as ``tracked``,
    ``start``, ``success``, ``seeds`` and ``n``, which are 1; and over all joints that turn the mean
    ``prediction error`` |predicted - demonstrated| and ``tracking error`` |tracked - predicted|.

    Raises:
        InputError: none of the motions can be replayed.
    """
    parts: list[pd.DataFrame] = []
    rows: list[dict[str, Any]] = []
    if isinstance(results.source, StoredResults):
        found = results.main(split="test")
        found = found[found.method != EXPERT].sort_values("seed", kind="stable")
        for _, of_task in found.groupby("task", sort=False):
            rows = of_task.drop_duplicates("method").to_dict("records")
            parts += _of_task(results, rows)
    if rows and not parts:
        raise InputError("no motion can be replayed; the lines above say why")
    empty = pd.DataFrame(columns=["row", "column", "value"])
    return in_order(pd.concat(parts), METHODS) if parts else empty


def _of_task(results: Results, rows: Sequence[dict[str, Any]]) -> list[pd.DataFrame]:
    """The motions of methods on one task; one that cannot be replayed is named on stderr."""
    start = _start_that_tells(results, rows)
    found, shown = [], {}
    for row in rows:
        try:
            if row["demos_key"] not in shown:
                shown[row["demos_key"]] = _demonstrated(row, start)
            whole = _motions(results, row, start, shown[row["demos_key"]])
        except InputError as error:
            print(f"bench: no motion of {row['method']} on {row['task']}: {error}", file=sys.stderr)
            continue
        turning = whole[whole.unit == "rad"]
        errors = {
            "prediction error": (turning.predicted - turning.demonstrated).abs().mean(),
            "tracking error": (turning.tracked - turning.predicted).abs().mean(),
        }
        part = whole[whole.joint.isin(telling(whole, JOINTS))]
        success = bool(results.outcomes(row).success[start])
        labels = {"row": row["method"], "column": row["task"], "start": start, "success": success}
        counts = {"seeds": 1, "n": 1}
        found.append(part.assign(value=part.tracked, **labels, **counts, **errors))
    return found


def _start_that_tells(results: Results, rows: Sequence[dict[str, Any]]) -> int:
    """The first start from which as close as can be to half of the methods succeed."""
    success = [results.outcomes(row).success.to_numpy(bool)[:COMPARED] for row in rows]
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
    """Returns a row of panels for each joint, a column for each method."""
    methods, tasks = ordered(table.row, METHODS), ordered(table.column, TASKS)
    lines = [
        (task, joint) for task in tasks for joint in table[table.column == task].joint.unique()
    ]
    size = (1.9 * len(methods) + 1.4, 1.15 * len(lines) + 0.9)
    drawing = Figure(figsize=size, layout="constrained")
    panels = drawing.subplots(len(lines), len(methods), squeeze=False, sharey="row", sharex=True)
    for line, (task, joint) in zip(panels, lines, strict=True):
        for axes, method in zip(line, methods, strict=True):
            here = (table.column == task) & (table.joint == joint) & (table.row == method)
            part = table[here]
            if len(part):
                _draw(axes, part, colour(method, methods))
                ended = "success" if part.success.iloc[0] else "failure"
                axes.set_title(ended, loc="right", fontsize=7.5, pad=2)
            axes.tick_params(labelsize=8)
        here = table[(table.column == task) & (table.joint == joint)]
        start = here.start.iloc[0]
        line[0].set_ylim(*_limits(here))
        line[0].set_ylabel(f"{display(task)}\nstart {start}\n{joint} [rad]", fontsize=7.5)
    for axes, method in zip(panels[0], methods, strict=True):
        axes.set_title(exhibit.display(method), pad=10)
    for axes in panels[-1]:
        axes.set_xlabel("time [s]")
    handles = [
        Line2D([], [], color="black", lw=1.0, label="demonstrated"),
        Line2D([], [], color="#666666", lw=1.4, ls=PREDICTED, label="predicted"),
        Line2D([], [], color="#666666", lw=1.8, label="tracked"),
        Patch(color="#666666", alpha=0.18, lw=0, label=BAND),
    ]
    drawing.legend(handles=handles, frameon=False, loc="outside lower center", ncols=len(handles))
    return drawing


def _limits(part: pd.DataFrame) -> tuple[float, float]:
    """The range of where joints were, and some more: a wild prediction leaves the panel."""
    seen = part[["demonstrated", "tracked"]]
    low, high = seen.min(axis=None), seen.max(axis=None)
    margin = 0.25 * (high - low) or 1.0
    return low - margin, high + margin


EXHIBIT = Exhibit(
    name="motions",
    title="Predicted and tracked motions",
    about="Figure: the two joints of each task that the demonstrated motion turns most, from one"
    " start of the task (its index beside the axis), the first at which methods differ, if there is"
    " one. Demonstrated is what the expert does from there, or, where methods learnt from other"
    " demonstrations, the nearest of those. Bands: the mean error of the prediction over validation"
    " demonstrations. Table: mean |predicted - demonstrated| and |tracked - predicted| in this"
    " episode, over all joints that turn [rad].",
    table=table,
    unit="rad",
    digits=3,
    axis="joint [rad]",
    figure=figure,
    summary=summary,
)
