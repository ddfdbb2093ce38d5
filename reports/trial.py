"""`bench try`: one method on one task, compared with the shipped methods on the same starts."""

from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bench.checking import known
from bench.experiments import cells_of
from bench.intervals import wilson
from bench.names import KEY_DIGITS
from bench.presets import Study
from bench.results import Results as StoredResults
from bench.spec import Cell
from bench.study_demos import demos_keys_of
from methods.registry import SUITE, introduced
from reports.pairing import without_expert
from reports.results import Results
from reports.stats import paired_difference, rate_interval
from tasks.data import BoolArray

COLUMNS = ("method", "success", "low", "high", "seeds", "n")
SETTINGS = ("setting", "here", "shipped")
DIFFERENCE = ("difference", "difference_low", "difference_high", "p")


@dataclass(frozen=True)
class Trial:
    """The result of one method on one task."""

    cell: Cell
    success: BoolArray
    """(N,) from the first N starts of ``test``."""
    diverged: int = 0
    """Number of episodes that diverged, for example after a prediction that is not finite."""

    @property
    def rate(self) -> dict[str, Any]:
        """Success [%] with its 95% Wilson interval, as a row with `COLUMNS`."""
        low, high = wilson(int(self.success.sum()), len(self.success))
        values = (100 * float(self.success.mean()), 100 * low, 100 * high, 1, len(self.success))
        return dict(zip(COLUMNS, (self.cell.fit.method, *values), strict=True))

    @property
    def failures(self) -> list[int]:
        """The starts from which the method failed."""
        return [int(start) for start in np.flatnonzero(~self.success)]

    def compare(self, reference: Results) -> pd.DataFrame:
        """Returns one row for each shipped method on the trial's starts, the best rate first.

        If a shipped method has met fewer starts, its row is about those. There are no rows if
        `differing_settings` has some, since the methods cannot be compared.

        Args:
            reference: the shipped results.

        Returns:
            The columns of `Trial.rate`, and ``difference``, the trial's success minus the shipped
            method's on the same starts, in points, with its 95% interval ``difference_low`` to
            ``difference_high`` and ``p``, see `reports.stats.paired_difference`.
        """
        theirs = self._others(reference)
        rows = []
        for method in theirs.method.unique() if self.differing_settings(reference).empty else ():
            found = reference.success(task=self.cell.fit.task, method=method, split="test")
            assert found is not None
            success = found[:, : len(self.success)]
            interval = rate_interval(success, f"{self.cell.fit.task} test {method}")
            ours = self.success[None, : success.shape[1]]
            pair = f"{self.cell.fit.task} test {self.cell.fit.method} {method}"
            difference = paired_difference(ours, success, pair).in_points
            per_cent = [100 * float(value) for value in (success.mean(), *interval)]
            rows.append((method, *per_cent, *success.shape, *difference))
        table = pd.DataFrame(rows, columns=[*COLUMNS, *DIFFERENCE])
        return table.sort_values("success", ascending=False, kind="stable", ignore_index=True)

    def differing_settings(self, reference: Results) -> pd.DataFrame:
        """Returns the settings in which the shipped methods differ from the trial.

        The key of the demonstrations covers the task, its version and model, the expert and
        MuJoCo. The key of the controller covers its training and the demonstrations.

        Returns:
            Columns ``setting``, ``here`` and ``shipped``, as text. No rows if nothing differs.
        """
        theirs = self._others(reference)
        if theirs.empty:
            return pd.DataFrame(columns=SETTINGS)
        fit, controller = self.cell.fit, self.cell.controller
        here = {"number of demonstrations": str(fit.demos), "demonstrations": fit.demos_key}
        names = {"number of demonstrations": "demos", "demonstrations": "demos_key"}
        if controller:
            here["controller"], names["controller"] = controller.key, "controller_key"
        shipped = {what: sorted(set(theirs[name].astype(str))) for what, name in names.items()}
        rows = [
            (what, value[:KEY_DIGITS], ", ".join(one[:KEY_DIGITS] for one in shipped[what]))
            for what, value in here.items()
            if shipped[what] != [value]
        ]
        if rows:
            made = {reference.source.facts(one)["versions"]["mujoco"] for one in theirs.folder}
            if made != {version("mujoco")}:
                rows.append(("MuJoCo", version("mujoco"), ", ".join(sorted(made))))
        return pd.DataFrame(rows, columns=SETTINGS)

    def _others(self, reference: Results) -> pd.DataFrame:
        """Returns the shipped evaluations of methods on the task's ``test`` starts."""
        return without_expert(reference.main(task=self.cell.fit.task, split="test"))


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
