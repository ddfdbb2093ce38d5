"""Sources of results: a results folder, packed results, or several of them combined."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bench.labels import labelled
from bench.names import CONDITIONS

if TYPE_CHECKING:  # reading results needs neither the methods nor MuJoCo
    import pandas as pd

    from methods.base import Parameters

NUMBERS = ("demos", "held_out", "seed")
"""Fields of a fit that are numbers."""
FIT_FIELDS = (
    *("task", "method", "variant", "size", "config", "demos", "held_out", "seed"),
    *("demos_key", "settings", "expert", "weights", "pins"),
)
TIMES = ("fit_seconds", "action_seconds")
"""The columns of what `bench time` measures."""
_SUMS = ("episodes", "successes", "diverged", *TIMES, "folder")
COLUMNS = (*FIT_FIELDS, *CONDITIONS, "controller_key", *_SUMS)
"""The columns of `Source.frame`."""
OUTCOMES = ("start", "success", "diverged", "steps")
"""The columns of `Source.outcomes`."""


class Source(Protocol):
    """Stored results, for reading."""

    def frame(self) -> pd.DataFrame:
        """Returns one row for each stored evaluation that a study has requested.

        Columns: the fields of `Fit` and `Evaluation`; the numbers of ``episodes``, ``successes``
        and ``diverged`` episodes; ``fit_seconds`` and ``action_seconds`` (NaN before
        `bench time` has measured them); ``folder``, which names the fit.

        Raises:
            InputError: there are no results.
        """

    def outcomes(self, row: Mapping[str, Any]) -> pd.DataFrame:
        """Returns `OUTCOMES` of each episode of a row of `frame`.

        Raises:
            InputError: the episodes are no longer there, or damaged.
        """

    def readings(self, row: Mapping[str, Any]) -> NDArray[np.float32] | None:
        """Returns the readings of the success rule after each control step (B, T-1) of a row.

        None if the source keeps no readings. Raises InputError as `outcomes` does.
        """

    def diagnostics(self, folder: str) -> Parameters:
        """Returns the diagnostics by name of the fit in a folder that `frame` names.

        Raises:
            InputError: the fit is no longer there, or damaged.
        """

    def facts(self, folder: str) -> dict[str, Any]:
        """Returns times, host and versions of the fit in a folder that `frame` names.

        Raises:
            InputError: the fit is no longer there, or damaged.
        """

    def notes(self) -> list[str]:
        """Returns notes for readers of the tables, such as about a reduced protocol."""

    def controller_spec(self, key: str) -> dict[str, Any]:
        """Returns the fields of the stored controller with that key.

        Raises:
            InputError: it is not there, or damaged.
        """


def numbered_outcomes(source: Source, rows: pd.DataFrame) -> pd.DataFrame:
    """Returns the outcomes of rows of `Source.frame` in one table.

    Columns: ``evaluation``, the number of the row, and `OUTCOMES`.
    """
    import pandas as pd

    parts = [source.outcomes(row) for row in rows.to_dict("records")]
    numbers = np.repeat(np.arange(len(rows), dtype=np.int32), [len(part) for part in parts])
    table = pd.concat(parts, ignore_index=True)[[*OUTCOMES]].astype({"start": np.int32})
    table.insert(0, "evaluation", numbers)
    return table


def outcomes_by_row(table: pd.DataFrame, rows: int) -> list[pd.DataFrame]:
    """Returns the outcomes of each of so many rows, from a table of `numbered_outcomes`."""
    ends = np.searchsorted(table.evaluation, np.arange(1, rows))
    table = table.drop(columns="evaluation").astype({"start": np.int64})
    return [table.iloc[a:b] for a, b in pairwise([0, *ends, len(table)])]


def episodes_table(source: Source) -> pd.DataFrame:
    """Returns the outcomes of every evaluation in one table, see `bench.load`."""
    import pandas as pd

    names = ["task", "method", "variant", "size", *NUMBERS, *CONDITIONS]
    found = source.frame()
    if found.empty:
        return pd.DataFrame(columns=[*names, *OUTCOMES])
    frame = labelled(found)
    table = numbered_outcomes(source, frame)
    rows = table.pop("evaluation")
    texts = set(names) - {*NUMBERS, "replan"}
    labels = frame[names].astype(dict.fromkeys(texts, "category"))
    return pd.concat([labels.iloc[rows].reset_index(drop=True), table], axis=1)
