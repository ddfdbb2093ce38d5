"""The opening of the page: what was run, the success of each seed, and starts that fail."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, floor
from typing import Any

import numpy as np
import pandas as pd

from bench.labels import EXPERT
from bench.packed import is_packed
from reports.exhibit import Exhibit, span
from reports.pairing import without_expert
from reports.results import Results
from reports.style import METHODS, TASKS, display, ordered

STEP = 10
"""Points of success. The strips of a task begin and end at multiples of it."""


def study_facts(results: Results) -> dict[str, str]:
    """Returns what was run, by name of the fact."""
    frame, found = results.frame, results.main(split="test")
    found = found if len(found) else frame
    methods = sorted(ordered(frame.method, METHODS), key=EXPERT.__eq__)  # the expert comes last
    days = results.finished
    seeds = found.groupby(["task", "method", "variant", "size", "demos"]).seed.nunique()
    alone = " (another training run may give another answer)" if seeds.max() == 1 else ""
    return {
        "study": results.name,
        "run": " to ".join(dict.fromkeys([days[0], days[-1]])) if days else "unknown",
        "methods": ", ".join(map(results.display, methods)),
        "tasks": ", ".join(map(display, ordered(frame.task, TASKS))),
        "seeds of a method": span(seeds) + alone,
        "starts": span(found.episodes),
    }


@dataclass(frozen=True)
class Strip:
    """The success of a method's seeds on a task, drawn on a line from 0 to 100."""

    text: str
    """Mean and interval [%]."""
    shares: str
    """Success of each seed, as text."""
    dots: list[float]
    """Place of each seed. `low` and `high` are the places of the interval's ends."""
    low: float
    high: float


def strips(results: Results, exhibit: Exhibit, table: pd.DataFrame) -> dict[str, Any]:
    """Returns the table of success with a dot for each seed.

    Args:
        results: of a run.
        exhibit: success on test starts.
        table: its table.

    Returns:
        ``columns``: the ``name`` of each task and the ``ends`` of its lines [%]. ``rows``: the
        ``name`` of each method, its ``cells``, a `Strip` or None, and whether it is the user's
        ``own``.
    """
    shares = {
        (row, task): _shares(results, row, task)
        for row, task in table[["row", "column"]].itertuples(index=False)
    }
    ends = {}
    for task, part in table.groupby("column", sort=False):
        known = np.concatenate([shares[row, task] for row in part.row])
        low = STEP * floor(min(known.min(), part.low.min()) / STEP)
        high = STEP * ceil(max(known.max(), part.high.max()) / STEP)
        ends[task] = low, max(high, low + STEP)
    cells = {
        (one.row, one.column): _strip(one, shares[one.row, one.column], *ends[one.column])
        for one in table.itertuples()
    }
    return {
        "columns": [{"name": display(str(task)), "ends": ends[task]} for task in ends],
        "rows": [
            {
                "name": exhibit.display(row),
                "own": exhibit.is_own(row),
                "cells": [cells.get((row, task)) for task in ends],
            }
            for row in table.row.drop_duplicates()
        ],
    }


def first_failures(results: Results, films: Mapping[str, str]) -> list[dict[str, Any]]:
    """Returns the first test start from which each method fails, with its first seed.

    Args:
        results: of a run.
        films: anchors of films on the page, by stem of their files.

    Returns:
        For each task and method: ``task``, ``method``, whether it is the user's ``own``, ``start``
        (None if it always succeeds), the ``film`` of that start or None, and the ``command`` that
        films it.
    """
    found = without_expert(results.main(split="test")).sort_values("seed", kind="stable")
    found = found.drop_duplicates(["task", "method"])
    # Packed results hold no fits to film: there the reader names a folder that does.
    place = "DIR" if is_packed(results.folder) else shlex.quote(str(results.folder))
    rows = []
    for task in ordered(found.task, TASKS):
        here = found[found.task == task].set_index("method", drop=False)
        for method in ordered(here.method, METHODS):
            success = results.outcomes(here.loc[method].to_dict()).success.to_numpy(bool)
            start = None if success.all() else int(np.argmin(success))
            rows.append(
                {
                    "task": display(task),
                    "method": results.display(method),
                    "own": method in results.own,
                    "start": start,
                    "film": films.get(f"{task}-start-{start}"),
                    "command": f"bench video {task} --results {place}"
                    f" --methods {shlex.quote(method)} --start {start}",
                }
            )
    return rows


def _shares(results: Results, method: str, task: str) -> np.ndarray:
    """Returns the success of each seed [%] (S,)."""
    success = results.success(method=method, task=task, split="test")
    return np.empty(0) if success is None else 100 * success.mean(axis=1)


def _strip(row: Any, shares: np.ndarray, low: float, high: float) -> Strip:
    def place(value: float) -> float:
        return round(100 * (value - low) / (high - low), 2)

    return Strip(
        text=f"{row.value:.1f} [{row.low:.1f}, {row.high:.1f}]",
        shares=", ".join(f"{share:.1f}%" for share in shares),
        dots=[place(share) for share in shares],
        low=place(row.low),
        high=place(row.high),
    )
