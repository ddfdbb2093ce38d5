"""Which episodes of a method fail, and how: a data frame, and a picture of their starts."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from matplotlib.figure import Figure

from bench.packed import is_packed
from reports.charts import add_marker_legend
from reports.results import SPLITS, Results
from reports.starts import draw_starts, start_values
from reports.style import METHODS, display, ordered
from tasks.errors import InputError, unknown_name
from tasks.words import count_of

if TYPE_CHECKING:
    from tasks.base import Task

SHOWN = 500
"""Number of starts of a split in a picture, the first ones."""
ELSEWHERE = "succeeds when replayed"
"""Mode of an episode that failed on another machine, whose numbers differ in the last digits."""
SUCCESS: dict[str, Any] = {"color": "#9cc3de", "marker": "o", "s": 12, "linewidths": 0}
FAILURES = (
    {"color": "#7a1f00", "marker": "x", "s": 26, "linewidths": 1.2},
    {"color": "#de8f05", "marker": "^", "s": 24, "linewidths": 0},
    {"color": "#4b2e83", "marker": "s", "s": 18, "linewidths": 0},
    {"color": "#029e73", "marker": "v", "s": 24, "linewidths": 0},
    {"color": "#222222", "marker": "+", "s": 30, "linewidths": 1.2},
    {"color": "#cc78bc", "marker": "D", "s": 16, "linewidths": 0},
)
"""How starts are drawn, by failure mode in the order of the task."""


def failures(
    folder: Path, task: str, method: str, split: str = "test", seed: int | None = None
) -> pd.DataFrame:
    """Returns one row for each failed episode of a method at its chosen size.

    Columns: ``start`` its index, ``seed``, ``split``, ``mode`` how it failed (see
    `tasks.base.Task.failure_modes`), a column for each number of the start, in its unit, and
    ``steps`` the control steps taken. Failed episodes are replayed to find their modes; the method
    of a package is replayed in a separate process. In packed results, which hold no fits, ``mode``
    is None.

    Args:
        folder: results of `bench run` or `bench pack`.
        task: name of a task.
        method: name of a method.
        split: ``test``, or ``ood`` for starts out of distribution.
        seed: of the fit. Default: all.

    Raises:
        InputError: there is no such task or split, or no results of the method or seed, or an
            episode cannot be replayed, see `bench.replay.replay`.
    """
    whole = episodes(folder, task, method, split, seed)
    return whole[~whole.success].drop(columns="success").reset_index(drop=True)


def episodes(
    folder: Path, task: str, method: str, split: str = "test", seed: int | None = None
) -> pd.DataFrame:
    """Returns all episodes, as `failures` does, with a column ``success``."""
    results = Results(folder)
    found = evaluations(results, task, method, split, seed)
    return pd.concat([_episodes(results, row) for row in found], ignore_index=True)


def _episodes(results: Results, row: dict[str, Any]) -> pd.DataFrame:
    from tasks.registry import get_task  # imports MuJoCo

    task, outcomes = get_task(row["task"]), results.outcomes(row)
    values = start_values(task, row["split"], len(outcomes), row["seed"])
    numbers = values.drop(columns="start")
    success = outcomes.success.to_numpy(bool)
    labels = {"seed": row["seed"], "split": row["split"], "mode": None}
    frame = values[["start"]].assign(**labels).astype({"mode": object}).join(numbers)
    failed = frame.start[~success].tolist()
    if failed and not is_packed(results.folder):
        frame.loc[~success, "mode"] = _modes(results.folder, task, row, failed)
    return frame.assign(steps=outcomes.steps.to_numpy(), success=success)


def _modes(folder: Path, task: "Task", row: dict[str, Any], failed: Sequence[int]) -> Sequence[str]:
    """Replays episodes that failed from these starts and returns their modes."""
    from bench.replay import replay  # imports torch

    fit = f"{row['method']}, seed {row['seed']}, {row['task']}, {row['split']}"
    print(f"replaying {count_of(len(failed), 'failed episode')}: {fit}", file=sys.stderr)
    seen = replay(folder, row, failed)
    return [str(mode) or ELSEWHERE for mode in task.modes(seen.episodes, seen.watched)]


def evaluations(
    results: Results, task: str, method: str, split: str, seed: int | None
) -> list[dict[str, Any]]:
    """Returns rows of the frame, by seed. Arguments and errors are those of `failures`."""
    from tasks.registry import get_task  # imports MuJoCo

    get_task(task)
    if split not in SPLITS:
        raise unknown_name("split", split, SPLITS)
    known = results.rows.methods(task=task, split=split)
    if not known:
        raise InputError(f"{results.folder} holds no results of task {task!r} on split {split!r}")
    if method not in known:
        raise unknown_name(f"method with results on {task}", method, known)
    found = results.rows.main(task=task, method=method, split=split).sort_values("seed")
    if seed is not None:
        seeds = found.seed.unique()
        found = found[found.seed == seed]
        if found.empty:
            have = ", ".join(map(str, seeds))
            raise InputError(f"{method} has no results of seed {seed} on {task}; it has {have}")
    return [{str(name): value for name, value in row.items()} for row in found.to_dict("records")]


def count_modes(task: "Task", whole: pd.DataFrame) -> pd.DataFrame:
    """Returns how often each failure mode occurs, in the task's order.

    Columns: ``split``, ``mode``, ``failed`` and ``episodes`` in numbers, ``share`` [%], and
    ``starts``, the list of their seeds and indices.

    Args:
        task: of the episodes.
        whole: as `episodes` returns it, of one method.
    """
    rows = []
    for split, part in whole.groupby("split", sort=False):
        failed = part[~part.success]
        for mode in modes_of(task, failed):
            failed_so = failed[failed["mode"].isna() if mode is None else failed["mode"] == mode]
            starts = set(zip(failed_so.seed.tolist(), failed_so.start.tolist(), strict=True))
            rows.append(
                {
                    "split": split,
                    "mode": mode,
                    "failed": len(starts),
                    "episodes": len(part),
                    "share": 100 * len(starts) / len(part),
                    "starts": sorted(starts),
                }
            )
    return pd.DataFrame(rows, columns=["split", "mode", "failed", "episodes", "share", "starts"])


def modes_of(task: "Task", failed: pd.DataFrame) -> list[Any]:
    """Returns the failure modes that occur, in the task's order. None is an unknown mode."""
    from tasks.base import DIVERGED  # imports MuJoCo

    order = (DIVERGED, *task.failure_modes, ELSEWHERE, None)
    found = set(failed["mode"])
    return [mode for mode in order if mode in found]


def draw_failures(task: "Task", by_method: dict[str, pd.DataFrame]) -> Figure:
    """Returns the first starts of each method's lowest seed, by success and failure mode.

    Args:
        task: of the starts.
        by_method: as `episodes` returns them.
    """
    names = ordered(by_method, METHODS)
    firsts = {name: by_method[name][lambda part: part.seed == part.seed.min()] for name in names}
    looks = _looks(task, pd.concat(firsts.values()))
    drawing = Figure(figsize=(max(3.1 * len(firsts), 5.2), 3.7), layout="constrained")
    panels = drawing.subplots(1, len(firsts), sharex=True, sharey=True, squeeze=False)[0]
    for axes, (method, part) in zip(panels, firsts.items(), strict=True):
        outcome = part["mode"].fillna("failure").where(~part.success, "success")
        draw_starts(axes, task, part.assign(outcome=outcome)[part.start < SHOWN], looks)
        axes.label_outer()
        failed = int((~part.success).sum())
        axes.set_title(
            f"{display(method)}, seed {part.seed.min()}: {failed:,} of {len(part):,} fail",
            fontsize=10,
        )
    shown = min(SHOWN, 1 + max(part.start.max() for part in firsts.values()))
    drawing.suptitle(
        f"{display(task.name)}: first {count_of(shown, 'start')} of each split\n(dashed: training"
        " distribution)",
        fontsize=11,
    )
    add_marker_legend(drawing, looks)
    return drawing


def _looks(task: "Task", whole: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Returns how starts are drawn, for each outcome that occurs."""
    looks = {"success": SUCCESS} if whole.success.any() else {}
    for place, mode in enumerate(modes_of(task, whole[~whole.success])):
        looks[mode or "failure"] = FAILURES[place % len(FAILURES)]
    return looks
