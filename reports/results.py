"""What the exhibits are made from: stored evaluations and diagnostics, summed up."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bench.controller_kinds import AUDITED
from bench.labels import EXPERT, labelled
from bench.packed import SHIPPED, open_results
from bench.selection import best_size
from bench.source import Source
from methods.base import Parameters
from reports.alike import on_common_ground
from reports.protocol import MARK, Unlike, differences
from reports.reference import Beside
from reports.remarks import OWN, Remark, remarks_on_the_expert
from reports.stats import rate_interval
from reports.style import METHODS, TASKS, ordered
from tasks.data import BoolArray, FloatArray
from tasks.errors import InputError
from tasks.registry import APPENDIX

SIZES = ("small", "median", "large")


class Results:
    """The results of a run."""

    unlike: Unlike | None = None
    """Rows that cannot be compared and are shown all the same."""

    def __init__(self, folder: Path, beside: bool = False) -> None:
        """Opens results.

        Args:
            folder: of `bench run`, or of `bench pack`.
            beside: whether to lay the shipped results of other methods beside them.

        Raises:
            InputError: see `reports.reference.Beside`.
        """
        self.folder = folder
        self.source: Source = open_results(folder)
        if beside:
            self.source = Beside(self.source)

    @cached_property
    def frame(self) -> pd.DataFrame:
        """One row for each stored evaluation, task by task, under the labels of `bench.labels`.

        Raises:
            InputError: there are none.
        """
        found = labelled(self.source.frame())
        if found.empty:
            raise InputError(
                "there are no evaluations to show yet: bench status says how far it is"
            )
        places = {name: place for place, name in enumerate(ordered(found.task, TASKS))}
        return found.sort_values(
            "task", key=lambda names: names.map(places), kind="stable", ignore_index=True
        )

    @property
    def notes(self) -> list[str]:
        """What a reader must know of the whole, such as a reduced protocol."""
        return self.source.notes() + (self.unlike.notes if self.unlike else [])

    @cached_property
    def remarks(self) -> list[Remark]:
        """What the captions of exhibits say of methods and controllers that they show."""
        found = remarks_on_the_expert(self.frame)
        return [*found, self.unlike.remark] if self.unlike else found

    @cached_property
    def suffixes(self) -> dict[str, str]:
        """By method, what follows its name in tables and figures."""
        marked = dict.fromkeys(self.unlike.marked, MARK) if self.unlike else {}
        return marked | ({EXPERT: OWN} if remarks_on_the_expert(self.frame) else {})

    @cached_property
    def own(self) -> frozenset[str]:
        """The methods that are not the suite's."""
        return frozenset(self.frame.method.unique()) - frozenset(METHODS)

    @property
    def name(self) -> str:
        """How people call the study: the name of its folder."""
        return "the shipped results" if self.folder == SHIPPED else self.folder.absolute().name

    @cached_property
    def finished(self) -> list[str]:
        """The days (YYYY-MM-DD) on which fits were finished, in order."""
        facts = (self.source.facts(folder) for folder in self.frame.folder.unique())
        return sorted({one["finished"][:10] for one in facts})

    @cached_property
    def provenance(self) -> list[dict[str, Any]]:
        """The hosts and versions that the fits come from, each once."""
        facts = [self.source.facts(folder) for folder in self.frame.folder.unique()]
        origins = [{"host": one["host"], "versions": one["versions"]} for one in facts]
        return [origin for i, origin in enumerate(origins) if origin not in origins[:i]]

    def check_versions(self) -> None:
        """Raises InputError if the fits come from several versions of a library."""
        versions = pd.DataFrame([origin["versions"] for origin in self.provenance])
        for library in versions.columns:
            found = sorted(versions[library].dropna().unique())
            if len(found) > 1:
                raise InputError(
                    f"the fits come from {library} {' and '.join(found)}, whose numbers need not"
                    " compare: give --mixed to show them all the same"
                )

    def check_protocol(self, rows: pd.DataFrame, mixed: bool = False) -> None:
        """Checks that rows of the frame can be compared, see `reports.protocol.differences`.

        Args:
            rows: that are laid beside each other.
            mixed: whether to show all the same those that cannot be compared; notes, captions and
                names then say what differs.

        Raises:
            InputError: rows cannot be compared, and are not to be mixed.
        """
        experts = self.frame[self.frame.method == EXPERT]
        found = differences(pd.concat([rows, experts]), self.controller_spec)
        if found.empty:
            return
        shipped = self.source.methods if isinstance(self.source, Beside) else ()
        unlike = Unlike(found, self.folder, shipped)
        if not mixed:
            raise unlike.refusal(rows)
        self.unlike = unlike

    def diagnostics(self, folder: str) -> Parameters:
        """Returns the diagnostics of the fit in a folder that the frame names."""
        return self.source.diagnostics(folder)

    def eigenvalues(self, folder: str) -> FloatArray:
        """Returns the real and imaginary parts (p, 2) of the eigenvalues that a fit has stored.

        Raises:
            InputError: it has stored none, or something else.
        """
        found = self._diagnostic(folder, "eigenvalues")
        if found.ndim != 2 or found.shape[1] != 2 or not found.size or not np.isfinite(found).all():
            raise InputError(
                f"{folder} has stored eigenvalues of shape {found.shape}, not finite ones of (p, 2)"
            )
        return found

    def imitation_error(self, folder: str) -> float:
        """Returns the mean imitation error over joints that a fit has stored.

        Raises:
            InputError: it has stored none.
        """
        return float(self._diagnostic(folder, "imitation_error").mean())

    def _diagnostic(self, folder: str, name: str) -> FloatArray:
        found = self.diagnostics(folder)
        if name not in found:
            raise InputError(f"{folder} has stored no {name.replace('_', ' ')}")
        return found[name]

    def controller_spec(self, key: str) -> dict[str, Any]:
        """Returns the fields of the controller with a key that the frame names."""
        return self.source.controller_spec(key)

    def outcomes(self, row: dict[str, Any]) -> pd.DataFrame:
        """Returns the episodes of a row of the frame, see `bench.source.Source.outcomes`."""
        return self.source.outcomes(row)

    def readings(self, row: dict[str, Any]) -> NDArray[np.float32] | None:
        """Returns the readings (B, T-1) of a row of the frame; None where they are not kept."""
        return self.source.readings(row)

    def success(self, **values: object) -> BoolArray | None:
        """Returns success of each seed's fit from each start, (S, N), of what `main` selects.

        None where there are no results; only the starts that all seeds have met are returned.
        """
        place = tuple(sorted(values.items()))
        if place not in self._successes:
            self._successes[place] = self.successes([values])[0]
        return self._successes[place]

    @cached_property
    def _successes(self) -> dict[tuple[tuple[str, object], ...], BoolArray | None]:
        """By what was selected, what `success` has returned: claims ask for the same repeatedly."""
        return {}

    def successes(self, selections: Sequence[Mapping[str, object]]) -> list[BoolArray | None]:
        """Returns what `success` does for several selections of a task, on common seeds and starts.

        See `reports.alike.on_common_ground`.
        """
        parts = [self.main(**values).assign(place=i) for i, values in enumerate(selections)]
        found = on_common_ground(pd.concat(parts), "place")
        chosen = (found[found.place == i].sort_values("seed") for i in range(len(parts)))
        return [self._stacked(self._episodes(one)) if len(one) else None for one in chosen]

    def rates(self, evaluations: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
        """Returns one row for each group: success over its seeds, in per cent.

        Of a task those starts count that all its fits have met, and the seeds of all methods, see
        `reports.alike.on_common_ground`.

        Columns: those of by, ``value`` the mean, ``spread`` the population standard deviation over
        seeds, ``low`` and ``high`` the 95% interval, ``seeds``, ``n`` episodes of each,
        ``diverged``.
        """
        rows = []
        for names, group in on_common_ground(evaluations).groupby(list(by), sort=False):
            episodes = self._episodes(group)
            success = self._stacked(episodes)
            share = 100 * success.mean(axis=1)
            low, high = rate_interval(success, names)
            rows.append(
                dict(zip(by, names, strict=True))
                | {
                    "value": share.mean(),
                    "spread": share.std() if len(share) > 1 else np.nan,
                    "low": 100 * low,
                    "high": 100 * high,
                    "seeds": len(share),
                    "n": success.shape[1],
                    "diverged": sum(int(one.diverged.sum()) for one in episodes),
                }
            )
        columns = [*by, "value", "spread", "low", "high", "seeds", "n", "diverged"]
        return pd.DataFrame(rows, columns=columns)

    def _episodes(self, evaluations: pd.DataFrame) -> list[pd.DataFrame]:
        """The first episodes of each evaluation, as many as its row says."""
        rows = evaluations.to_dict("records")
        return [self.outcomes(row).iloc[: row["episodes"]] for row in rows]

    @staticmethod
    def _stacked(episodes: Sequence[pd.DataFrame]) -> BoolArray:
        return np.stack([one.success.to_numpy(bool) for one in episodes])

    def select(self, **values: object) -> pd.DataFrame:
        """Returns the evaluations with these values.

        Unless told: of nominal physics, of the methods as described, judged by appendix C, and not
        with the controllers that `audit` alone tries.
        """
        wanted = {"variant": "described", "physics": "nominal", "rule": APPENDIX} | values
        frame = self.frame
        keep = np.logical_and.reduce([frame[name] == value for name, value in wanted.items()])
        if "controller" not in values:
            keep &= ~frame.controller.isin(AUDITED)
        return frame[keep]

    def main(self, **values: object) -> pd.DataFrame:
        """Returns the evaluations of `chosen` on the most demonstrations that a method has seen."""
        found = self.chosen(**values)
        if found.empty:
            return found
        return found[found.demos == found.groupby(["task", "method"]).demos.transform("max")]

    def chosen(self, **values: object) -> pd.DataFrame:
        """Returns the evaluations with these values of each method at its chosen size."""
        found = self.select(**values)
        if found.empty:
            return found
        best = []
        for (task, method), part in found.groupby(["task", "method"]):
            size = self._best_size(str(task), str(method), list(part["size"].unique()))
            best.append(pd.Series(size, index=part.index))
        return found[found["size"] == pd.concat(best).reindex(found.index)]

    def _best_size(self, task: str, method: str, there: Sequence[str]) -> str:
        """The size that does best from validation starts, where several were evaluated."""
        place = task, method, *sorted(there)
        if place not in self._best_sizes:
            sizes = [size for size in dict.fromkeys((*SIZES, *there)) if size in there]
            compared = self.select(task=task, method=method, split="validation")
            self._best_sizes[place] = best_size(compared, sizes)
        return self._best_sizes[place]

    @cached_property
    def _best_sizes(self) -> dict[tuple[str, ...], str]:
        """By task, method and the sizes that there are, what `_best_size` has returned."""
        return {}
