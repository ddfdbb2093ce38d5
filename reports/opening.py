"""The opening of the page: what was run, the success of each seed, and starts that fail."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor
from typing import Any

import numpy as np
import pandas as pd

from bench.labels import EXPERT
from bench.packed import is_packed
from reports.exhibit import Exhibit, span
from reports.pairing import keep_common, without_expert
from reports.results import Results
from reports.seed_statistics import ONE_SEED
from reports.style import METHODS, display, ordered
from reports.submitted_rows import SubmittedRow
from tasks.data import FloatArray
from tasks.files import file_name
from tasks.registry import SECOND, TASKS

STEP = 10
"""Points of success. The strips of a task begin and end at multiples of it."""
CLOSED = (
    "Methods marked closed loop are not in the paper: they see states on the way and act"
    " themselves. The table Beyond the paper has letters for all methods."
)
Shares = dict[tuple[str, str], FloatArray]


def study_facts(results: Results) -> dict[str, str]:
    """Returns what was run, by name of the fact."""
    frame, found = results.frame, results.rows.main(split="test")
    found = found if len(found) else frame
    methods = sorted(ordered(frame.method, METHODS), key=EXPERT.__eq__)  # the expert comes last
    days = results.finished
    seeds = found.groupby(["task", "method", "variant", "size", "demos"]).seed.nunique()
    alone = f" ({ONE_SEED})" if seeds.max() == 1 else ""
    return {
        "study": results.name,
        "run": " to ".join(dict.fromkeys([days[0], days[-1]])) if days else "unknown",
        "methods": ", ".join(map(results.display, methods)),
        **({"learnt from": "the second expert"} if results.expert == SECOND else {}),
        "tasks": ", ".join(map(display, ordered(frame.task, TASKS))),
        "seeds of a method": span(seeds) + alone,
        "starts of a seed": span(found.episodes),
    }


@dataclass(frozen=True)
class Strip:
    """The success of a method's seeds on a task, drawn on a line from 0 to 100."""

    text: str
    """Mean, interval and letters [%]."""
    shares: str
    """Success of each seed, as text."""
    dots: list[float]
    """Place of each seed. `low` and `high` are the places of the interval's ends."""
    low: float
    high: float
    single: bool
    """Whether the interval speaks of a single fit."""


def strips(
    results: Results,
    exhibit: Exhibit,
    table: pd.DataFrame,
    beyond: pd.DataFrame,
    submitted: Sequence[SubmittedRow] = (),
) -> dict[str, Any]:
    """Returns the table of success with a dot for each seed.

    Args:
        results: of a run.
        exhibit: success on test starts.
        table: its table.
        beyond: the table of all methods, of which those beyond the paper are shown below it.
        submitted: rows to show below it.

    Returns:
        ``columns``: the ``name`` of each task and the ``ends`` of its lines [%]. ``rows``: the
        ``name`` of each method, its ``cells``, a `Strip` or None, and whether it is the user's
        ``own``. ``beyond`` and ``submitted``: likewise, with the ``mark`` of each and no letters.
        ``footnotes``: what a reader must know of them.
    """
    shares = _shares(results, keep_common(results.rows.main(split="test")))
    theirs = [_shares(one.results, one.evaluations) for one in submitted]
    beyond = beyond[beyond.row.isin(results.rows.beyond)].assign(letters="")
    seen = _shares(results, keep_common(results.rows.of_all(split="test"))) if len(beyond) else {}
    parts = [
        (table, shares),
        (beyond, seen),
        *((one.table, its) for one, its in zip(submitted, theirs, strict=True)),
    ]
    ends = {task: _ends(parts, task) for task in table["column"].unique()}
    return {
        "columns": [{"name": display(str(task)), "ends": ends[task]} for task in ends],
        "rows": [
            {
                "name": exhibit.display(row),
                "own": exhibit.is_own(row),
                "cells": _cells(exhibit, table[table.row == row], shares, ends),
            }
            for row in table.row.drop_duplicates()
        ],
        "beyond": [
            {
                "name": exhibit.display(row),
                "mark": "closed loop",
                "cells": _cells(exhibit, beyond[beyond.row == row], seen, ends),
            }
            for row in beyond.row.drop_duplicates()
        ],
        "submitted": [
            {
                "name": exhibit.display(one.name),
                "mark": one.mark,
                "cells": _cells(exhibit, one.table, its, ends),
            }
            for one, its in zip(submitted, theirs, strict=True)
        ],
        "footnotes": [
            *exhibit.footnotes(table),
            *([CLOSED] if len(beyond) else []),
            *_about(submitted),
        ],
    }


def _ends(parts: Sequence[tuple[pd.DataFrame, Shares]], task: str) -> tuple[int, int]:
    """Returns the ends of a task's lines, of all tables with the success of their seeds."""
    known = [
        value
        for table, shares in parts
        for one in table[table["column"] == task].itertuples()
        for value in (one.low, one.high, *shares[one.row, task])
    ]
    low, high = STEP * floor(min(known) / STEP), STEP * ceil(max(known) / STEP)
    return low, max(high, low + STEP)


def _cells(
    exhibit: Exhibit, row: pd.DataFrame, shares: Shares, ends: Mapping[str, tuple[int, int]]
) -> list[Strip | None]:
    """Returns the strip of each task, None where the row has no value."""
    found = {one["column"]: one for one in row.to_dict("records")}
    return [
        _strip(exhibit, found[task], shares[found[task]["row"], task], *ends[task])
        if task in found
        else None
        for task in ends
    ]


def _about(submitted: Sequence[SubmittedRow]) -> list[str]:
    """Returns what a reader must know of submitted rows."""
    if not submitted:
        return []
    below = (
        "Below the rule: methods of other packages, run and submitted by their authors on the same"
        " demonstrations, controllers and starts, without letters. Of verified rows, a maintainer"
        " repeated a random sample bit by bit."
    )
    return [below, *(one.note for one in submitted)]


def first_failures(results: Results, films: Mapping[str, str]) -> list[dict[str, Any]]:
    """Returns the first test start from which each method fails, with its first seed.

    Args:
        results: of a run.
        films: anchors of films on the page, by stem of their files.

    Returns:
        For each task and method that fails: ``task``, ``method``, whether it is the user's ``own``,
        ``seed``, its ``start``, the ``film`` of that start or None, and the ``command`` that films
        it.
    """
    found = without_expert(results.rows.main(split="test")).sort_values("seed", kind="stable")
    found = found.drop_duplicates(["task", "method"])
    # Packed results hold no fits to film: there the reader names a folder that does.
    place = "DIR" if is_packed(results.folder) else shlex.quote(str(results.folder))
    rows = []
    for task in ordered(found.task, TASKS):
        here = found[found.task == task].set_index("method", drop=False)
        for method in ordered(here.method, METHODS):
            seed = here.loc[method].seed
            success = results.outcomes(here.loc[method].to_dict()).success.to_numpy(bool)
            if success.all():
                continue
            start = int(np.argmin(success))
            rows.append(
                {
                    "task": display(task),
                    "method": results.display(method),
                    "own": method in results.own,
                    "seed": seed,
                    "start": start,
                    "film": _film_of(films, task, method, f"s{seed}-start-{start}"),
                    "command": f"bench video {task} --results {place}"
                    f" --methods {shlex.quote(method)} --seed {seed} --start {start}",
                }
            )
    return rows


def _film_of(films: Mapping[str, str], task: str, method: str, start: str) -> str | None:
    """Returns the anchor of a film of a method from a start, as `bench video` names it."""
    named = f"-{file_name([method])}-"
    for stem, anchor in films.items():
        if stem.startswith(f"{task}-") and stem.endswith(f"-{start}") and named in stem:
            return anchor
    return None


def _shares(results: Results, found: pd.DataFrame) -> Shares:
    """Returns the success of each seed [%] (R,) by method and task, of rows on test starts."""
    return {
        (method, task): 100 * results.episodes.paired(mine, ["method"])[method,].mean(axis=1)
        for (method, task), mine in found.groupby(["method", "task"])
    }


def _strip(
    exhibit: Exhibit, row: dict[str, Any], shares: FloatArray, low: float, high: float
) -> Strip:
    def place(value: float) -> float:
        return round(100 * (value - low) / (high - low), 2)

    return Strip(
        text=exhibit.text(row | {"spread": np.nan}),
        shares=", ".join(f"{share:.1f}%" for share in shares),
        dots=[place(share) for share in shares],
        low=place(row["low"]),
        high=place(row["high"]),
        single=row["basis"] == ONE_SEED,
    )
