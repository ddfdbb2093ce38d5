"""Results opened in Python: tables of evaluations and episodes, fitted methods, single episodes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from bench.options import results_folder
from bench.packed import is_packed, open_results, shipped
from bench.results import Results
from bench.source import episodes_table
from bench.views import view
from tasks.errors import InputError
from tasks.files import path_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from bench.fitted import Methods


class Opened:
    """A results folder, opened to read. Nothing is written to it, nor kept open."""

    def __init__(self, folder: str | Path | None = None) -> None:
        """Opens results.

        Args:
            folder: of `bench run` or `bench pack`. Default: the shipped results.

        Raises:
            InputError: the folder holds no results.
        """
        given = shipped() if folder is None else path_of("folder", folder)
        self.folder: Path = results_folder(given, packed=True)
        """Where the results are."""
        self._source = open_results(self.folder)

    def __repr__(self) -> str:
        return f"bench.open({str(self.folder)!r})"

    @cached_property
    def frame(self) -> pd.DataFrame:
        """One row for each evaluation, see `bench.source.Source.frame`."""
        return self._source.frame()

    @cached_property
    def episodes(self) -> pd.DataFrame:
        """One row for each episode, see `bench.load`."""
        return episodes_table(self._source)

    @property
    def notes(self) -> list[str]:
        """What a reader of the results must know, such as a reduced protocol."""
        return self._source.notes()

    def methods(self, task: str, *, seed: int | None = None, size: str | None = None) -> Methods:
        """Returns the fitted methods of a task by name, as described in the paper.

        Each is loaded when it is asked for by name, with what it learnt from the most
        demonstrations. A method of a package is imported into this very process then.

        Args:
            task: name of a task.
            seed: of the fit. Default: the lowest that is stored.
            size: of the model. Default: the one that does best from validation starts.

        Raises:
            InputError: the results hold no fits of that task, or are packed, without fits.
        """
        from bench.fitted import Methods  # needs MuJoCo, which tables do without

        if is_packed(self.folder):
            raise InputError(
                f"{self.folder} holds packed results, without fits: open a results folder of"
                " `bench run`"
            )
        return Methods(Results(self.folder), self.frame, task, seed, size)

    def failures(
        self, task: str, method: str, split: str = "test", seed: int | None = None
    ) -> pd.DataFrame:
        """Returns the episodes where a method fails, one row each, and how it fails.

        Columns: ``start`` its index, ``seed``, ``split``, ``mode`` how it fails (None in packed
        results, which hold no fits to replay), the numbers of the start, and ``steps``.

        Args:
            task: name of a task.
            method: name of a method with results of that task.
            split: where the starts are from: ``test``, or ``ood``.
            seed: of the fit. Default: all.

        Raises:
            InputError: there are no such results.
        """
        found: pd.DataFrame = view("failures")(self.folder, task, method, split=split, seed=seed)
        return found

    def plot_motion(
        self,
        task: str,
        method: str,
        start: int,
        joints: Sequence[str] | None = None,
        seed: int | None = None,
    ) -> Figure:
        """Returns a figure of an episode's joints over time: predicted, tracked, demonstrated.

        Args:
            task: name of a task.
            method: name of a method with results of that task.
            start: index of a start of ``test``.
            joints: names of joints, such as ``ARRx``. Default: the three that turn most.
            seed: of the fit. Default: the lowest that is stored.

        Raises:
            InputError: there are no such results, start or joint; or the results are packed, and
                hold no fits.
        """
        frame = view("motions")(self.folder, task, method, start, seed=seed)
        figure: Figure = view("draw_motion")(frame, joints)
        return figure
