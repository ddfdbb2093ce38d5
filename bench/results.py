"""Reads the results of `bench run` from their folder, and never writes.

Every file is checked before it is used. A damaged file is reported once and counts as missing. The
evaluations of a damaged fit count as missing too.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from bench.manifest import Manifest, Wanted, read_manifest
from bench.names import (
    CONDITIONS,
    KEY_DIGITS,
    USUAL,
    Named,
    cell_path,
    controller_path,
    evaluation_name,
    evaluation_path,
    failure_path,
)
from bench.sealed_files import DamagedError, content_names, read_content, read_table
from bench.source import COLUMNS, OUTCOMES
from bench.stored_files import (
    CONTROLLER,
    DIAGNOSTICS,
    FIT,
    TIMES,
    WEIGHTS,
    Times,
    non_finite_of,
    read_evaluation,
    read_failure,
    read_learnt,
    read_times,
    software_of,
)
from tasks.data import NonFinite
from tasks.errors import InputError
from tasks.files import from_bytes

if TYPE_CHECKING:  # reading results needs neither the methods nor MuJoCo
    import pandas as pd

    from methods.base import Parameters

T = TypeVar("T")
Stamp = tuple[tuple[int, int, int] | None, ...]
"""Identifies a version of files: it changes when they do."""
REPORTED: set[tuple[Path, Stamp]] = set()
"""Damage that this process has reported already; it may open a folder several times."""


class Results:
    """A results folder. Every call reads its present state."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.absolute()  # the working folder may change
        self.damaged: dict[Path, str] = {}
        """Files and folders that were found damaged, each with the reason."""
        self._checked: dict[Path, tuple[Stamp, Any]] = {}

    def check_exists(self) -> None:
        """Raises InputError if the folder holds no results."""
        if not (self.folder / "cells").exists():
            raise InputError(f"{self.folder} holds no results: bench run writes them there")

    def manifest(self) -> Manifest:
        """Returns the manifest: which evaluations studies have requested.

        Raises:
            InputError: the manifest is damaged.
        """
        return read_manifest(self.folder)

    def notes(self) -> list[str]:
        """See `bench.source.Source.notes`.

        Raises:
            InputError: the manifest is damaged.
        """
        return list(self.manifest().notes)

    # Fits and controllers
    def marks(self) -> set[str]:
        """Returns the marks of the kernels of requested and stored results, see `tasks.pins`.

        Stored fits and controllers count even if no study requests them.

        Raises:
            InputError: the manifest is damaged.
        """
        asked = {wanted.pins for wanted in self.manifest().wanted if wanted.pins}
        paths = [
            *self.folder.glob(f"cells/*/{FIT}"),
            *self.folder.glob(f"controllers/*/{CONTROLLER}"),
        ]
        records = (self._learnt(path.parent, path.name) for path in sorted(paths))
        return asked | {record["spec"]["pins"] for record in records if record}

    def has_fit(self, fit: Named) -> bool:
        """Whether the fit is stored and undamaged."""
        return self._fit(fit) is not None

    def has_controller(self, controller: Named) -> bool:
        """Whether the controller is stored and undamaged."""
        record = self._learnt(controller_path(self.folder, controller), CONTROLLER)
        return record is not None and record["key"] == controller.key

    def parameters(self, fit: Named) -> bytes:
        """Returns the learnt parameters of a stored fit, see `tasks.files.from_bytes`.

        Raises:
            InputError: it is not there, or damaged.
        """
        return self._contents(cell_path(self.folder, fit), FIT, [WEIGHTS])[WEIGHTS]

    def controller_weights(self, controller: Named) -> bytes:
        """Returns the weights of a stored controller, see `tasks.files.from_bytes`.

        Raises:
            InputError: it is not there, or damaged.
        """
        path = controller_path(self.folder, controller)
        return self._contents(path, CONTROLLER, [WEIGHTS])[WEIGHTS]

    def fit_files(self, fit: Named) -> dict[str, bytes]:
        """Returns the content of the files of a stored fit, without its times and evaluations.

        Raises:
            InputError: it is not there, or damaged.
        """
        return self._contents(cell_path(self.folder, fit), FIT)

    def controller_files(self, controller: Named) -> dict[str, bytes]:
        """Returns the content of the files of a stored controller.

        Raises:
            InputError: it is not there, or damaged.
        """
        return self._contents(controller_path(self.folder, controller), CONTROLLER)

    def controller_spec(self, key: str) -> dict[str, Any]:
        """See `bench.source.Source.controller_spec`."""
        for folder in (self.folder / "controllers").glob(f"*-{key[:KEY_DIGITS]}"):
            record = self._learnt(folder, CONTROLLER)
            if record and record["key"] == key:
                return dict(record["spec"])
        raise InputError(f"{self.folder} lacks the controller {key}: run the study again")

    def controller_facts(self, controller: Named) -> dict[str, Any]:
        """Returns times, host and software of a stored controller, see `facts`."""
        return dict(self._required(controller_path(self.folder, controller), CONTROLLER)["facts"])

    def fit_facts(self, fit: Named) -> dict[str, Any]:
        """Returns times, host and software of a stored fit, see `facts`."""
        return self.facts(cell_path(self.folder, fit).name)

    def facts(self, folder: str) -> dict[str, Any]:
        """See `bench.source.Source.facts`."""
        return dict(self._required(self.folder / "cells" / folder, FIT)["facts"])

    def diagnostics(self, folder: str) -> Parameters:
        """See `bench.source.Source.diagnostics`."""
        path = self.folder / "cells" / folder
        if DIAGNOSTICS not in content_names(self._required(path, FIT)):
            return {}
        return from_bytes(self._contents(path, FIT, [DIAGNOSTICS])[DIAGNOSTICS])

    def times(self, folder: str) -> Times | None:
        """Returns the times of the fit in a folder that `frame` names, if measured."""
        path = self.folder / "cells" / folder / TIMES
        return self._unless_damaged(path, partial(read_times, path))

    # Evaluations
    def stored_episodes(self, wanted: Wanted) -> int:
        """Returns the number of undamaged stored episodes of an evaluation.

        Episodes of another version of the task or controller do not count, nor do those of a
        missing or damaged fit. No episode is decoded.
        """
        return self._evaluation(wanted)[1]

    def episodes(self, wanted: Wanted) -> pd.DataFrame | None:
        """Returns the episodes that `stored_episodes` counts, one row each, or None."""
        if not self.stored_episodes(wanted):
            return None
        frame: pd.DataFrame = self.table(self._path(wanted)).to_pandas()
        return frame

    def evaluation_labels(self, wanted: Wanted) -> Mapping[str, str]:
        """Returns the labels of the episodes that `stored_episodes` counts, or none.

        See `bench.stored_files.read_evaluation`.
        """
        return self._evaluation(wanted)[0]

    def frame(self) -> pd.DataFrame:
        """See `bench.source.Source.frame`."""
        import pandas as pd  # slow to import, and `bench status` does without

        self.check_exists()
        rows = [
            self._row(wanted) for wanted in self.manifest().wanted if self.stored_episodes(wanted)
        ]
        return pd.DataFrame(rows, columns=COLUMNS)

    def outcomes(self, row: Mapping[str, Any]) -> pd.DataFrame:
        """See `bench.source.Source.outcomes`."""
        frame: pd.DataFrame = self.table(self._path_of(row), OUTCOMES).to_pandas()
        return frame

    def readings(self, row: Mapping[str, Any]) -> NDArray[np.float32]:
        """See `bench.source.Source.readings`."""
        column = self.table(self._path_of(row), ["readings"])["readings"].combine_chunks()
        return np.asarray(column.flatten()).reshape(len(column), -1)

    def table(self, path: Path, columns: Sequence[str] | None = None) -> pa.Table:
        """Returns the episodes of an evaluation's file, or some of their columns.

        Raises:
            InputError: the file is not there, or damaged.
        """
        try:
            return read_table(path, columns)
        except DamagedError as error:
            raise InputError(f"{error}: run the study again") from error

    def non_finite(self) -> Iterator[tuple[dict[str, Any], int, list[NonFinite]]]:
        """Yields the evaluations in which a method's answers were not finite.

        Each comes with the fields of its fit, its number of episodes, and which answers were not
        finite.
        """
        for wanted in self.manifest().wanted:
            labels, count = self._evaluation(wanted)
            if "non_finite" in labels and (record := self._fit(wanted.fit)):
                yield record["spec"], count, non_finite_of(labels)

    def code(self) -> Iterator[set[tuple[str, str]]]:
        """Yields, for each stored evaluation, the packages' code that computed it and its fit.

        It has the items of ``code`` of `bench.provenance.software`.
        """
        for wanted in self.manifest().wanted:
            labels, count = self._evaluation(wanted)
            if count:
                parts = [self.fit_facts(wanted.fit), *software_of(labels)]
                yield {item for part in parts for item in part.get("code", {}).items()}

    # Failures
    def failures(self) -> list[dict[str, Any]]:
        """Returns the failed jobs without a result: label, tries, reason, traceback."""
        paths = sorted((self.folder / "failures").glob("*.json"))
        return [found for path in paths if (found := self._failure(path))]

    def tries(self, label: str) -> int:
        """Returns how often the job of that label has failed."""
        found = self._failure(failure_path(self.folder, label))
        return int(found["tries"]) if found else 0

    def _failure(self, path: Path) -> dict[str, Any] | None:
        return self._unless_damaged(path, partial(read_failure, path))

    # Checks
    def _fit(self, fit: Named) -> dict[str, Any] | None:
        record = self._learnt(cell_path(self.folder, fit), FIT)
        return record if record and record["key"] == fit.key else None

    def _learnt(self, folder: Path, name: str) -> dict[str, Any] | None:
        """The record of a fit or controller; None if it is not there or damaged."""
        files = [folder / file for file in (name, WEIGHTS, DIAGNOSTICS)]
        return self._unless_damaged(folder, partial(read_learnt, folder, name), files)

    def _required(self, folder: Path, name: str) -> dict[str, Any]:
        record = self._learnt(folder, name)
        if record is None:
            raise InputError(f"{folder} is missing or damaged: run the study again")
        return record

    def _contents(
        self, folder: Path, name: str, chosen: Sequence[str] | None = None
    ) -> dict[str, bytes]:
        """The content of chosen files of a fit or controller, or of all."""
        record = self._required(folder, name)
        try:
            if chosen:
                return {file: read_content(folder, record, file) for file in chosen}
            found = {file: read_content(folder, record, file) for file in content_names(record)}
            return {**found, name: (folder / name).read_bytes()}
        except DamagedError as error:
            raise InputError(f"{error}: run the study again") from error

    def _evaluation(self, wanted: Wanted) -> tuple[Mapping[str, str], int]:
        """The labels and the number of the stored episodes of an evaluation; if none, ({}, 0)."""
        path = self._path(wanted)
        if not self.has_fit(wanted.fit):
            return {}, 0
        found = self._unless_damaged(path, partial(read_evaluation, path, wanted.fit.key))
        return found if found and found[0]["key"] == wanted.evaluation.key else ({}, 0)

    def _path(self, wanted: Wanted) -> Path:
        return evaluation_path(self.folder, wanted.fit, wanted.evaluation.label)

    def _path_of(self, row: Mapping[str, Any]) -> Path:
        return self.folder / "cells" / row["folder"] / f"{evaluation_name(row)}.parquet"

    def _row(self, wanted: Wanted) -> dict[str, Any]:
        folder = cell_path(self.folder, wanted.fit)
        labels, count = self._evaluation(wanted)
        times = self.times(folder.name) or Times([])
        return {
            **USUAL,
            **self._required(folder, FIT)["spec"],
            **{name: labels[name] for name in (*CONDITIONS, "controller_key")},
            "replan": int(labels["replan"]),
            "episodes": count,
            "successes": int(labels["successes"]),
            "diverged": int(labels["diverged"]),
            "fit_seconds": _median(times.fit),
            "action_seconds": _median(times.action),
            "folder": folder.name,
        }

    def _unless_damaged(
        self, path: Path, read: Callable[[], T], files: Sequence[Path] = ()
    ) -> T | None:
        """Reads a path; returns None if it is missing, or damaged, which is recorded.

        Args:
            path: the path to set aside if it is damaged.
            read: reads it; raises DamagedError.
            files: the files to read, if not the path itself. Unchanged files are not read again.
        """
        if not path.exists():
            return None
        stamp = tuple(map(_stamp, files or (path,)))
        before = self._checked.get(path)
        if before and before[0] == stamp:
            return before[1]
        try:
            found = read()
        except DamagedError as error:
            if path.exists():  # else a run has just set it aside
                self.damaged[path] = error.reason
                self.report(path, stamp, error.reason)
            return None
        self._checked[path] = stamp, found
        self.damaged.pop(path, None)
        return found

    def report(self, path: Path, stamp: Stamp, reason: str) -> None:
        """Says on stderr that something is damaged, once in a process until it changes."""
        if (path, stamp) not in REPORTED:
            REPORTED.add((path, stamp))
            advice = "the next `bench run` sets it aside"
            print(f"{path} is damaged ({reason}); {advice}", file=sys.stderr)


def _median(times: Sequence[float]) -> float:
    """Returns the median, NaN of nothing."""
    return float(np.median(times)) if times else np.nan


def _stamp(path: Path) -> tuple[int, int, int] | None:
    """Identifies a version of a file; None if it is not there."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns
