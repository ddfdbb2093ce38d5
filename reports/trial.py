"""`bench try`: one method on one task, compared with the shipped methods on the same starts."""

from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bench.checking import known
from bench.experiments import cells_of
from bench.names import KEY_DIGITS
from bench.presets import Study
from bench.results import Results as StoredResults
from bench.spec import Cell
from bench.study_demos import demos_keys_of
from methods.registry import SUITE, introduced
from reports.pairing import without_expert
from reports.results import Results
from reports.seed_statistics import difference, rate
from tasks.data import BoolArray

COLUMNS = ("method", "success", "low", "high", "basis", "seeds", "n")
SETTINGS = ("setting", "here", "shipped")
DIFFERENCE = ("difference", "difference_low", "difference_high", "p")


@dataclass(frozen=True)
class Trial:
    """The result of one method on one task."""

    cell: Cell
    success: BoolArray
    """(N,) from the first N starts of ``test`` of the seed."""
    diverged: int = 0
    """Number of episodes that diverged, for example after a prediction that is not finite."""

    @property
    def rate(self) -> dict[str, Any]:
        """Success [%] with its 95% interval, as a row with `COLUMNS`."""
        return dict(zip(COLUMNS, _row(self.cell.fit.method, self.success[None]), strict=True))

    @property
    def failures(self) -> list[int]:
        """The starts from which the method failed."""
        return [int(start) for start in np.flatnonzero(~self.success)]

    def compare(self, reference: Results) -> pd.DataFrame:
        """Returns one row for each shipped method with the trial's seed, the best rate first.

        It has learnt from the same demonstrations and met the same starts. Intervals and p speak of
        these fits and their controller only.

        If a shipped method has met fewer starts, its row is about those. There are no rows if
        `differing_settings` has some, since the methods cannot be compared.

        Args:
            reference: the shipped results.

        Returns:
            The columns of `Trial.rate`, and ``difference``, the trial's success minus the shipped
            method's on the same starts, in points, with its 95% interval ``difference_low`` to
            ``difference_high`` and ``p``, see `reports.seed_statistics.difference`.
        """
        theirs = self._others(reference)
        rows = []
        for method in theirs.method.unique() if self.differing_settings(reference).empty else ():
            there = reference.episodes.paired(theirs[theirs.method == method], ["method"])
            success = there[method,][:, : len(self.success)]
            pair = difference(self.success[None, : success.shape[1]], success)
            points = [100 * value for value in (pair.value, pair.low, pair.high)]
            rows.append((*_row(method, success), *points, pair.p))
        table = pd.DataFrame(rows, columns=[*COLUMNS, *DIFFERENCE])
        return table.sort_values("success", ascending=False, kind="stable", ignore_index=True)

    def differing_settings(self, reference: Results) -> pd.DataFrame:
        """Returns the settings in which the shipped methods differ from the trial.

        The key of the demonstrations covers the task, its version and model, the expert, MuJoCo
        and the kernels. The key of the controller covers its training, the demonstrations and the
        kernels. So if kernels differ, keys tell nothing else.

        Returns:
            Columns ``setting``, ``here`` and ``shipped``, as text. No rows if nothing differs.
        """
        theirs = self._others(reference)
        if theirs.empty:
            return pd.DataFrame(columns=SETTINGS)
        fit, controller = self.cell.fit, self.cell.controller
        here = [
            ("number of demonstrations", str(fit.demos), "demos"),
            ("kernels", fit.pins, "pins"),
        ]
        if set(theirs.pins) == {fit.pins}:
            here.append(("demonstrations", fit.demos_key, "demos_key"))
            if controller:
                here.append(("controller", controller.key, "controller_key"))
        rows = [
            (what, value[:KEY_DIGITS], ", ".join(one[:KEY_DIGITS] for one in shipped))
            for what, value, name in here
            if (shipped := sorted(set(theirs[name].astype(str)))) != [value]
        ]
        if rows:
            made = {reference.source.facts(one)["versions"]["mujoco"] for one in theirs.folder}
            if made != {version("mujoco")}:
                rows.append(("MuJoCo", version("mujoco"), ", ".join(sorted(made))))
        return pd.DataFrame(rows, columns=SETTINGS)

    def _others(self, reference: Results) -> pd.DataFrame:
        """Returns the shipped evaluations on the trial's starts, of methods that act as it does.

        Closed-loop methods stand beside a closed-loop one alone.
        """
        fit, rows = self.cell.fit, reference.rows
        shown = rows.main if self.cell.controller else rows.of_all
        return without_expert(shown(task=fit.task, split="test", seed=fit.seed))


def _row(method: str, success: BoolArray) -> tuple[Any, ...]:
    """Returns the values of `COLUMNS`, given success (1, N)."""
    found = rate(success)
    per_cent = [100 * value for value in (found.value, found.low, found.high)]
    return (method, *per_cent, found.basis, *success.shape)


def trial_of(study: Study, folder: Path) -> Trial:
    """Returns the trial that a finished study of one method on one task has stored."""
    (name,) = study.methods
    with introduced() as introduce:
        if name not in SUITE:
            introduce(known(name))
        (cell,) = cells_of(study, demos_keys_of(study))
        stored = StoredResults(folder).episodes(cell.wanted)
    assert stored is not None
    episodes = stored.iloc[: cell.episodes]
    return Trial(cell, episodes.success.to_numpy(bool), int(episodes.diverged.sum()))
