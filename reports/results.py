"""The results of a run as exhibits see them: their rows, episodes, and where they come from."""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bench.labels import EXPERT, labelled
from bench.packed import SHIPPED, open_results
from bench.source import Source
from methods.base import Parameters
from reports.episodes import Episodes
from reports.mixed import MARK, MixedProtocols
from reports.protocol import differences
from reports.reference import WithShippedMethods
from reports.remarks import OWN, Remark, remarks_on_the_expert
from reports.rows import Rows
from reports.style import METHODS, display, ordered
from tasks.errors import InputError
from tasks.registry import EXPERTS, FIRST, SECOND, TASKS

SPLITS = ("test", "ood")
"""The splits on which methods are compared: in and out of distribution."""


class Results:
    """The results of a run."""

    mixed: MixedProtocols | None = None
    """Rows that cannot be compared and are shown nevertheless."""
    _expert = ""

    def __init__(self, folder: Path, with_shipped: bool = False, expert: str = "") -> None:
        """Opens results.

        Args:
            folder: of `bench run` or `bench pack`.
            with_shipped: whether to add the shipped results of other methods.
            expert: only what this expert taught is shown. Default: the first in the results.

        Raises:
            InputError: see `reports.reference.WithShippedMethods`.
        """
        self.folder = folder
        self.source: Source = open_results(folder)
        if with_shipped:
            self.source = WithShippedMethods(self.source)
        self._expert = expert

    @cached_property
    def frame(self) -> pd.DataFrame:
        """One row for each stored evaluation of the `expert`, by task.

        Methods have the labels of `bench.labels`.

        Raises:
            InputError: there are none.
        """
        found = labelled(self._everything[self._everything.expert == self.expert])
        if found.empty:
            raise InputError(
                "there are no evaluations to show yet: bench status shows the progress"
            )
        places = {name: place for place, name in enumerate(ordered(found.task, TASKS))}
        found = found.sort_values(
            "task", key=lambda names: names.map(places), kind="stable", ignore_index=True
        )
        # One block of Python's strings: pandas picks rows of it faster than of a block a column.
        return found.astype(dict.fromkeys(found.select_dtypes("str"), object)).copy()

    @cached_property
    def rows(self) -> Rows:
        """Selects rows of the `frame`."""
        return Rows(self.frame)

    @cached_property
    def episodes(self) -> Episodes:
        """Success of episodes of rows of the `frame`."""
        return Episodes(self.outcomes)

    @cached_property
    def experts(self) -> list[str]:
        """Which experts have taught methods in the results, the first one first."""
        return ordered(self._everything.expert, EXPERTS)

    @cached_property
    def _everything(self) -> pd.DataFrame:
        return self.source.frame()

    @property
    def expert(self) -> str:
        """Which expert taught the methods that are shown."""
        return self._expert or next(iter(self.experts), FIRST)

    def taught_by(self, expert: str) -> "Results":
        """Returns the results of what that expert taught, opened once."""
        if expert not in self._taught:
            self._taught[expert] = Results(self.folder, expert=expert)
        return self._taught[expert]

    @cached_property
    def _taught(self) -> dict[str, "Results"]:
        """Cache of `taught_by`."""
        return {}

    @property
    def notes(self) -> list[str]:
        """What a reader must know of all results, such as a reduced protocol."""
        return [*self.source.notes(), *self._on_experts, *(self.mixed.notes if self.mixed else [])]

    @property
    def _on_experts(self) -> list[str]:
        if self.expert == SECOND:
            return ["All methods learnt from the second expert of a task."]
        if SECOND in self.experts:
            return [
                "The first expert of each task taught these methods. What changes with the second"
                " is in the tables two_experts and expert_change of a report."
            ]
        return []

    @cached_property
    def remarks(self) -> list[Remark]:
        """What the captions of exhibits say of their methods and controllers."""
        found = remarks_on_the_expert(self.frame)
        return [*found, self.mixed.remark] if self.mixed else found

    @cached_property
    def suffixes(self) -> dict[str, str]:
        """Text after the name of a method in tables and figures, by method."""
        marked = dict.fromkeys(self.mixed.marked, MARK) if self.mixed else {}
        return marked | ({EXPERT: OWN} if remarks_on_the_expert(self.frame) else {})

    def display(self, method: str) -> str:
        """Returns the name of a method as readers see it."""
        return display(method, self.suffixes)

    @cached_property
    def own(self) -> frozenset[str]:
        """The user's methods: those that are not the suite's."""
        return frozenset(self.frame.method.unique()) - frozenset(METHODS)

    @property
    def name(self) -> str:
        """The name of the study for readers: that of its folder."""
        return "the shipped results" if self.folder == SHIPPED else self.folder.absolute().name

    @cached_property
    def finished(self) -> list[str]:
        """The days (YYYY-MM-DD) on which fits were finished, in order."""
        facts = (self.source.facts(folder) for folder in self.frame.folder.unique())
        return sorted({one["finished"][:10] for one in facts})

    @cached_property
    def provenance(self) -> list[dict[str, Any]]:
        """The distinct hosts and versions of the fits."""
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
                    " compare: give --mixed to show them nevertheless"
                )

    def check_protocol(self, rows: pd.DataFrame, mixed: bool = False) -> None:
        """Checks that rows of the frame can be compared, see `reports.protocol.differences`.

        Args:
            rows: to be compared.
            mixed: whether to show rows that cannot be compared nevertheless. Notes, captions and
                names then say what differs.

        Raises:
            InputError: rows cannot be compared, and `mixed` is false.
        """
        experts = self.frame[self.frame.method == EXPERT]
        found = differences(pd.concat([rows, experts]), self.controller_spec)
        if found.empty:
            return
        shipped = self.source.methods if isinstance(self.source, WithShippedMethods) else ()
        protocols = MixedProtocols(found, self.folder, shipped, tuple(self.source.notes()))
        if not mixed:
            raise protocols.error(rows)
        self.mixed = protocols

    def diagnostics(self, folder: str) -> Parameters:
        """Returns the diagnostics of a fit, given its ``folder`` in the frame."""
        return self.source.diagnostics(folder)

    def controller_spec(self, key: str) -> dict[str, Any]:
        """Returns the fields of a controller, given its ``controller_key`` in the frame."""
        return self.source.controller_spec(key)

    def outcomes(self, row: dict[str, Any]) -> pd.DataFrame:
        """Returns the episodes of a row of the frame, see `bench.source.Source.outcomes`."""
        return self.source.outcomes(row)

    def readings(self, row: dict[str, Any]) -> NDArray[np.float32] | None:
        """Returns the readings (B, T-1) of a row of the frame. None if they are not stored."""
        return self.source.readings(row)
