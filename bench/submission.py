"""A submitted row: the results of a method from a package, in one sealed file.

The file is a table of `bench.sealed_files`: `bench.source.numbered_outcomes` of its evaluations. A
label of it is a JSON object::

    method, version          name and version of the method
    package                  see `bench.package_source.PackageSource`
    missing                  tasks that it leaves out
    evaluations              rows of `bench.source.Source.frame`, each with its `DIGESTS`
    fits                     times, host and versions of each fit by its folder
    controllers              fields of each controller by its key

Reading it needs neither the package nor any method.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from bench.labels import SEPARATOR
from bench.manifest import Name
from bench.names import CONDITIONS, KEY_DIGITS, controller_label, fit_key
from bench.package_source import PackageSource
from bench.results import Results
from bench.sealed_files import DamagedError, check, read_labels, read_table, reading, seal_table
from bench.source import COLUMNS, FIT_FIELDS, TIMES, numbered_outcomes, outcomes_by_row
from tasks.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

    from methods.base import Parameters

LABEL = "submitted row"
DIGESTS = ("method_weights", "controller_weights", "readings")
"""SHA-256 of what the method and the controller learnt (empty without one), and of what the success
rule read."""
_TABLE = pa.schema(
    [
        ("evaluation", pa.int32()),
        ("start", pa.int32()),
        ("success", pa.bool_()),
        ("diverged", pa.bool_()),
        ("steps", pa.int16()),
    ]
)
_NUMBERS = ("demos", "held_out", "seed", "replan", "episodes", "successes", "diverged")


@dataclass(frozen=True)
class Origin:
    """The method of a row, and what it leaves out."""

    method: str
    version: int
    package: PackageSource
    missing: tuple[str, ...] = ()


class Submission:
    """A file of `bench submit`, for reading; a `bench.source.Source`."""

    digest: str
    """SHA-256 of the file."""
    origin: Origin
    _rows: list[dict[str, Any]]
    """The evaluations, with their digests."""

    def __init__(self, path: Path) -> None:
        """Reads a file.

        Raises:
            InputError: it is none of `bench submit`, or damaged.
        """
        self.path = path
        try:
            self._read()
        except DamagedError as error:
            raise InputError(f"{error}: name a file of `bench submit`") from error

    def _read(self) -> None:
        path = self.path
        with reading(path):
            self.digest = hashlib.sha256(path.read_bytes()).hexdigest()
            table, (labels, _) = read_table(path), read_labels(path)
            record = json.loads(labels[LABEL])
            self.origin = _origin(path, record)
            self._rows, self._fits = record["evaluations"], record["fits"]
            self._controllers = record["controllers"]
            for row in self._rows:
                _check_row(path, row)
                check(row["method"] == self.origin.method, path, "its method")
                check(isinstance(self._fits[row["folder"]]["versions"], dict), path, "its versions")
            check(len(self._places) == len(self._rows) > 0, path, "its evaluations")
            _check_episodes(path, table, len(self._rows))
            self._episodes = outcomes_by_row(table.to_pandas(), len(self._rows))

    @property
    def label(self) -> str:
        """The name of the row: its method, with the changes of `--set`."""
        settings = dict.fromkeys(row["settings"] for row in self._rows)
        return SEPARATOR.join([self.origin.method, *filter(None, settings)])

    # As a source
    def frame(self) -> pd.DataFrame:
        """See `bench.source.Source.frame`."""
        import pandas as pd

        return pd.DataFrame(self._rows).assign(**dict.fromkeys(TIMES, np.nan))[[*COLUMNS]]

    def outcomes(self, row: Mapping[str, Any]) -> pd.DataFrame:
        """See `bench.source.Source.outcomes`."""
        return self._episodes[self._places[_place(row)]].reset_index(drop=True)

    def readings(self, row: Mapping[str, Any]) -> None:
        """Returns None: the file holds only their digests."""

    def diagnostics(self, folder: str) -> Parameters:
        """Returns nothing: the file holds no diagnostics."""
        return {}

    def facts(self, folder: str) -> dict[str, Any]:
        """See `bench.source.Source.facts`."""
        return dict(self._fits[folder])

    def notes(self) -> list[str]:
        """Returns nothing: what a reader must know stands beside the row."""
        return []

    def controller_spec(self, key: str) -> dict[str, Any]:
        """See `bench.source.Source.controller_spec`."""
        if key not in self._controllers:
            raise InputError(f"{self.path} lacks the controller {key}")
        return dict(self._controllers[key])

    # Checks
    def check_keys(self) -> None:
        """Checks that each evaluation has the key of its fields, and the counts of its episodes.

        Raises:
            InputError: one has not.
        """
        for row, found in zip(self._rows, self._episodes, strict=True):
            place = f"{self.path.name}: {row['task']}, seed {row['seed']}, {row['split']}"
            fields = {name: row[name] for name in FIT_FIELDS}
            key = fit_key(self.origin.version, fields)[:KEY_DIGITS]
            if row["folder"].rpartition("-")[2] != key:
                raise InputError(f"{place}: the fit has not the key of its fields ({key})")
            counts = len(found), int(found.success.sum()), int(found.diverged.sum())
            if counts != (row["episodes"], row["successes"], row["diverged"]):
                raise InputError(f"{place}: the counts are not those of its episodes")
            if list(found.start) != list(range(len(found))):
                raise InputError(f"{place}: the starts are not the first {len(found)} of the split")

    def difference(self, row: Mapping[str, Any], again: Results) -> str:
        """Returns in which bits an evaluation differs from its repetition, or nothing.

        Args:
            row: of `frame`.
            again: results that hold the same evaluation with as many episodes.
        """
        stored, repeated = self._rows[self._places[_place(row)]], digests(again, row)
        different = [name.replace("_", " ") for name in DIGESTS if stored[name] != repeated[name]]
        return f"other {' and '.join(different)}" if different else ""

    @cached_property
    def _places(self) -> dict[tuple[Any, ...], int]:
        return {_place(row): number for number, row in enumerate(self._rows)}


def seal_submission(origin: Origin, results: Results, rows: pd.DataFrame) -> bytes:
    """Returns the content of a file that `Submission` reads.

    Args:
        origin: of the row.
        results: that hold it.
        rows: the rows of their frame that it consists of.
    """
    columns = [name for name in COLUMNS if name not in TIMES]
    evaluations = [row | digests(results, row) for row in rows[columns].to_dict("records")]
    keys = [key for key in rows.controller_key.unique() if key]
    record = asdict(origin) | {
        "evaluations": evaluations,
        "fits": {fit: results.facts(fit) for fit in rows.folder.unique()},
        "controllers": {key: results.controller_spec(key) for key in keys},
    }
    table = pa.Table.from_pandas(numbered_outcomes(results, rows), _TABLE, preserve_index=False)
    return seal_table(table, {LABEL: json.dumps(record, sort_keys=True)})


def digests(results: Results, row: Mapping[str, Any]) -> dict[str, str]:
    """Returns the `DIGESTS` of a row of results."""
    label, _, digits = row["folder"].rpartition("-")
    key, controller = row["controller_key"], b""
    if key:
        name = Name(controller_label(results.controller_spec(key)), key)
        controller = results.controller_weights(name)
    weights, readings = results.parameters(Name(label, digits)), results.readings(row).tobytes()
    contents = (weights, controller, readings)
    found = (hashlib.sha256(content).hexdigest() if content else "" for content in contents)
    return dict(zip(DIGESTS, found, strict=True))


def _origin(path: Path, record: Mapping[str, Any]) -> Origin:
    """Returns the origin of a row. Raises DamagedError if it has other types."""
    package = PackageSource(**record["package"])
    missing = tuple(record["missing"])
    texts = (package.name, package.version, *package.files, *package.files.values(), *missing)
    check(all(isinstance(text, str) for text in texts), path, "its package")
    check(type(record["version"]) is int, path, "its version")
    return Origin(record["method"], record["version"], package, missing)


def _check_episodes(path: Path, table: pa.Table, rows: int) -> None:
    """Raises DamagedError unless a table holds the episodes of so many rows, in order."""
    check(table.schema.remove_metadata() == _TABLE, path, "its table")
    check(not any(column.null_count for column in table.columns), path, "its episodes")
    numbers = table["evaluation"].to_numpy()
    check(list(np.unique(numbers)) == list(range(rows)), path, "its episodes")
    check(bool((np.diff(numbers) >= 0).all()), path, "the order of its episodes")


def _check_row(path: Path, row: Mapping[str, Any]) -> None:
    """Raises DamagedError unless an evaluation has the fields and types of one."""
    check({*row} == {*COLUMNS, *DIGESTS} - {*TIMES}, path, "an evaluation")
    texts = {*row} - {*_NUMBERS, "config"}
    check(all(type(row[name]) is int for name in _NUMBERS), path, "a number")
    check(all(type(row[name]) is str for name in texts), path, "a text")
    check(isinstance(row["config"], dict) and "/" not in row["folder"], path, "an evaluation")


def _place(row: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(row[name] for name in ("folder", *CONDITIONS))
