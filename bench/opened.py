"""Results in Python: tables of evaluations and episodes, fitted methods, single episodes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from bench.controller_kinds import COMPARED
from bench.labels import OF_SECOND, VALIDATION, labelled
from bench.names import PLAIN
from bench.options import results_folder
from bench.packed import is_packed, open_results, shipped
from bench.results import Results
from bench.selection import best_validated
from bench.source import episodes_table
from bench.views import view
from tasks.errors import InputError, unknown_name
from tasks.files import path_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from bench.fitted import Methods


class Opened:
    """A results folder, opened for reading. Nothing is written, and no file stays open."""

    def __init__(self, folder: str | Path | None = None) -> None:
        """Opens results.

        Args:
            folder: results folder of `bench run` or `bench pack`. Default: the shipped results.

        Raises:
            InputError: the folder holds no results.
        """
        given = shipped() if folder is None else path_of("folder", folder)
        self.folder: Path = results_folder(given, packed=True)
        """The results folder."""
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

    def plain(self, split: str = "test") -> pd.DataFrame:
        """Returns the episodes of the main comparison, in which nothing is changed.

        Methods as described, which the first expert taught if both did, each on each task in one
        size (see `at_best_size`) and with the most demonstrations; nominal physics, appendix C's
        rule, no disturbance, the original controller or none, and motions that are predicted once.
        The columns are those of `episodes`.

        Args:
            split: ``test``, ``ood`` (out of distribution) or ``validation``.

        Raises:
            InputError: the results have no such split.
        """
        found = self.episodes
        if split not in set(found.split):
            raise unknown_name("split with results", split, found.split.unique())
        for name, value in (PLAIN | {"split": split, "variant": "described"}).items():
            found = found[found[name] == value]
        second = found.method.str.contains(OF_SECOND)
        found = self.at_best_size(found[found.controller.isin(COMPARED) & ~second])
        most = found.groupby(["task", "method"], observed=True).demos.transform("max")
        return found[found.demos == most]

    def at_best_size(self, episodes: pd.DataFrame) -> pd.DataFrame:
        """Returns the episodes of each method on each task in one of its sizes.

        Of the sizes among these episodes it is the one with most success from validation starts,
        as in reports. A mean over several sizes would be that of no method.

        Args:
            episodes: rows of `episodes` of one condition, such as one disturbance.
        """
        frame = labelled(self.frame)
        evaluations = frame[(frame.split == VALIDATION) & (frame.variant == "described")]
        best = {}
        for (task, method), part in episodes.groupby(["task", "method"], observed=True):
            mine = (evaluations.task == task) & (evaluations.method == method)
            best[task, method] = best_validated(evaluations[mine], part["size"])
        chosen = [best[place] for place in zip(episodes.task, episodes.method, strict=True)]
        return episodes[episodes["size"].astype(str) == chosen]

    @property
    def notes(self) -> list[str]:
        """Notes that a reader of the results needs, such as about a reduced protocol."""
        return self._source.notes()

    def methods(self, task: str, *, seed: int | None = None, size: str | None = None) -> Methods:
        """Returns the fitted methods of a task by name, as described in the paper.

        A method is loaded when it is looked up by name. If it was fitted to several numbers of
        demonstrations, the fit to the most is loaded. The look-up of a package's method imports it
        into this process.

        Args:
            task: name of a task.
            seed: seed of the fit. Default: the lowest that is stored.
            size: size of the model. Default: the one with most success from validation starts.

        Raises:
            InputError: the results hold no fits of that task, or are packed, without fits.
        """
        from bench.fitted import Methods  # imports MuJoCo, which tables do not need

        if is_packed(self.folder):
            raise InputError(
                f"{self.folder} holds packed results, without fits: open a results folder of"
                " `bench run`"
            )
        return Methods(Results(self.folder), self.frame, task, seed, size)

    def failures(
        self, task: str, method: str, split: str = "test", seed: int | None = None
    ) -> pd.DataFrame:
        """Returns the failed episodes of a method, one row each, with how they failed.

        Columns: ``start`` (index of the start), ``seed``, ``split``, ``mode`` (how the episode
        failed; None in packed results, which hold no fits to replay), the values of the start, and
        ``steps``.

        Args:
            task: name of a task.
            method: name of a method with results of that task.
            split: ``test`` or ``ood`` (out of distribution).
            seed: seed of the fit. Default: all.

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
        """Returns a figure of an episode's joints over time: predicted, tracked and demonstrated.

        Args:
            task: name of a task.
            method: name of a method with results of that task.
            start: index of a start of ``test``.
            joints: names of joints, such as ``ARRx``. Default: the three that move most.
            seed: seed of the fit. Default: the lowest that is stored.

        Raises:
            InputError: there are no such results, start or joint, or the results are packed,
                without fits.
        """
        frame = view("motions")(self.folder, task, method, start, seed=seed)
        figure: Figure = view("draw_motion")(frame, joints)
        return figure
