"""Joints over time in one episode: predicted, tracked and demonstrated."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bench.labels import EXPERT
from bench.results import Results as StoredResults
from reports.failing import evaluations
from reports.results import Results
from tasks.data import CONTROL_STEP, FloatArray
from tasks.errors import InputError, unknown_name

DASHES = (0, (3, 1.2))
"""Dashes of a predicted motion."""
BAND = "mean prediction error"


def motions(
    folder: Path, task: str, method: str, start: int, seed: int | None = None
) -> pd.DataFrame:
    """Returns the motion of the hand's joints in one stored episode of ``test``.

    There is a row for each joint and time, with these columns:

    - ``t`` [s], ``joint``, and ``unit`` (rad or m) of the following ones;
    - ``predicted`` by the method; NaN where it acts in closed loop;
    - ``tracked`` in the episode; NaN once it has diverged;
    - ``demonstrated`` by the suite's expert from the same start, or, where the fit learnt from
      other demonstrations, in the one with the nearest start;
    - ``error``, the fit's mean |predicted - demonstrated| over time on validation demonstrations.

    Args:
        folder: results of `bench run`.
        task: name of a task.
        method: name of a method.
        start: index of a start of ``test`` that was evaluated.
        seed: of the fit. Default: the lowest.

    Raises:
        InputError: there is no such task, method, seed or start, or the results are packed and
            hold no fits, or the episode cannot be replayed, see `bench.replay.replay`.
    """
    from bench.replay import check_starts  # imports torch

    results = Results(folder)
    if not isinstance(results.source, StoredResults):
        raise InputError(f"{folder} holds packed results, without the fits that motions need")
    row = evaluations(results, task, method, "test", seed)[0]
    check_starts(row, [start])
    return replayed_motion(results, row, start, demonstrated_motion(row, start))


def replayed_motion(
    results: Results, row: Mapping[str, Any], start: int, demonstrated: FloatArray
) -> pd.DataFrame:
    """Returns what `motions` does, for a row of the frame and the demonstrated joints (T, H)."""
    from bench.replay import replay  # imports torch
    from tasks.registry import get_task

    task = get_task(row["task"])
    seen = replay(results.folder, row, [start], whole=True)
    tracked = seen.joints[0]
    nothing = np.full_like(tracked, np.nan)
    predicted = nothing if seen.planned is None else seen.planned[0]
    error = results.diagnostics(row["folder"]).get("imitation_error", nothing[0])
    times = CONTROL_STEP * np.arange(len(tracked))
    parts = [
        pd.DataFrame(
            {
                "t": times,
                "joint": joint.name,
                "predicted": predicted[:, place],
                "tracked": tracked[:, place],
                "demonstrated": demonstrated[:, place],
                "error": float(error[place]),
                "unit": joint.unit,
            }
        )
        for place, joint in enumerate(task.components[: task.robot_dim])
    ]
    return pd.concat(parts, ignore_index=True)


def demonstrated_motion(row: Mapping[str, Any], start: int) -> FloatArray:
    """Returns the joints (T, H) that a fit was to imitate from a start of ``test``."""
    from tasks.demos import expert_of, load_adopted
    from tasks.experts import load_expert
    from tasks.recorder import record
    from tasks.registry import get_task

    task = get_task(row["task"])
    here = task.sample("test", start + 1, row["seed"])[start:]
    if row["method"] == EXPERT or expert_of(task, row["demos_key"], row["pins"]):
        shown = record(task, here, load_expert(task, row["expert"]).policy, failures=True)[1]
    else:
        demos = load_adopted(task, row["demos_key"])
        width = np.subtract(task.in_distribution.high, task.in_distribution.low)
        distance = np.linalg.norm((demos.starts.values - here.values) / width, axis=1)
        shown = demos[np.array([distance.argmin()])]
    if not len(shown):  # it diverged
        return np.full((task.horizon, task.robot_dim), np.nan)
    return shown.states[0, :, : task.robot_dim]


def draw_motion(frame: pd.DataFrame, joints: Sequence[str] | None = None) -> Figure:
    """Returns a panel for each joint, with predicted, tracked and demonstrated over time.

    Args:
        frame: as `motions` returns it.
        joints: names. Default: the three that turn most in the demonstrated motion.

    Raises:
        InputError: there is no such joint.
    """
    known = frame.joint.unique().tolist()
    chosen = list(joints) if joints else most_turning(frame, 3)
    for joint in chosen:
        if joint not in known:
            raise unknown_name("joint", joint, known)
    drawing = Figure(figsize=(6.4, 1.7 * len(chosen) + 0.6), layout="constrained")
    panels = drawing.subplots(len(chosen), sharex=True, squeeze=False)[:, 0]
    for axes, joint in zip(panels, chosen, strict=True):
        part = frame[frame.joint == joint]
        draw_joint(axes, part, "#0173b2")
        axes.set_ylabel(f"{joint} [{part.unit.iloc[0]}]")
    panels[-1].set_xlabel("time [s]")
    handles, labels = panels[0].get_legend_handles_labels()
    drawing.legend(handles, labels, frameon=False, loc="outside upper center", ncols=len(labels))
    return drawing


def draw_joint(axes: Axes, part: pd.DataFrame, shade: str) -> None:
    """Draws the rows of one joint of `motions`, with the error as a band around the prediction."""
    axes.plot(part.t, part.demonstrated, color="black", lw=1.0, label="demonstrated")
    if part.predicted.notna().any():
        low, high = part.predicted - part.error, part.predicted + part.error
        axes.fill_between(part.t, low, high, color=shade, alpha=0.18, lw=0, label=BAND)
        axes.plot(part.t, part.predicted, color=shade, lw=1.4, ls=DASHES, label="predicted")
    axes.plot(part.t, part.tracked, color=shade, lw=1.8, label="tracked")


def most_turning(frame: pd.DataFrame, count: int) -> list[str]:
    """Returns the joints that turn most [rad] in the demonstrated motion, in the hand's order."""
    turning = frame[frame.unit == "rad"].groupby("joint", sort=False).demonstrated
    reach = (turning.max() - turning.min()).nlargest(count)
    return [joint for joint in frame.joint.unique() if joint in reach.index]
