"""Results on disk: written once, checked on each reading, listed as a data frame.

A results folder holds::

    study.json                  what has been asked for: tables show this and no more
    cells/<label>-<key>/        one fit
        fit.json                what it is, times, host, versions, SHA-256 of the two below
        weights.safetensors     what it learnt; diagnostics.safetensors: what is worth a look
        eval-<split>-<physics>-<controller>-<rule>.parquet  one row an episode
        times.json              how long the fit takes with the machine to itself
    controllers/<label>-<key>/  a tracking controller: controller.json, weights.safetensors
    failures/                   why there is no result yet, one file each
    damaged/                    what did not pass its check or is of another version, set aside

Whatever exists is complete: it was written under another name, flushed to the disk and renamed.
Nothing read back is ever executed or unpickled.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from bench.controller_kinds import NO_CONTROLLER, ON_SUCCESSES, TUNED
from bench.labels import labelled
from tasks.data import NonFinite
from tasks.errors import InputError
from tasks.files import flush, from_bytes, sync, writable_folder
from tasks.masses import NOMINAL

if TYPE_CHECKING:  # what reads results needs neither the methods nor MuJoCo
    import pandas as pd

    from bench.spec import Cell, ControllerSpec, Evaluation, Fit
    from methods.base import Parameters
    from tasks.data import Episodes

FORMAT = 1
KEY_DIGITS = 12
CONDITIONS = ("split", "physics", "controller", "rule")
"""What tells the evaluations of a fit apart."""
NUMBERS = ("demos", "seed")
_FIT = ("task", "method", "variant", "size", "config", "demos", "seed", "demos_key", "settings")
_SUMS = ("episodes", "successes", "diverged", "fit_seconds", "folder")
COLUMNS = (*_FIT, *CONDITIONS, "controller_key", *_SUMS)
"""Of what `Store.frame` returns."""
_SEAL = re.compile(rb"sha256:[0-9a-f]{64}")
_KEY, _FILE = re.compile("[0-9a-f]{64}"), re.compile("[^/\\0]+")
_UNSEALED = b"sha256:" + b"0" * 64


def evaluation_name(conditions: Mapping[str, Any]) -> str:
    """Returns the name of an evaluation's file, without ending."""
    return "-".join(("eval", *(str(conditions[name]) for name in CONDITIONS)))


class DamagedError(Exception):
    """A stored file is not what was written."""


class Store:
    """A results folder. Only one process may write to it, inside `locked`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.absolute()  # wherever this process goes
        self.cells, self.controllers = self.folder / "cells", self.folder / "controllers"

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keeps other writers out, and clears away what an earlier one left unfinished.

        Raises:
            InputError: another process writes to the folder, or it cannot be written to.
        """
        writable_folder(self.folder).mkdir(parents=True, exist_ok=True)
        try:
            with FileLock(self.folder / ".lock", timeout=0):
                shutil.rmtree(self.folder / ".unfinished", ignore_errors=True)
                yield
        except Timeout as error:
            raise InputError(f"another run is writing to {self.folder}: wait for it") from error

    # Fits
    def has_fit(self, fit: Fit) -> bool:
        """Whether the fit is there; one that is damaged is set aside."""
        return self._record(self._cell(fit), fit.key) is not None

    def add_fit(
        self, fit: Fit, weights: bytes, diagnostics: bytes, facts: Mapping[str, Any]
    ) -> None:
        """Stores a fit, from the content of its files; facts are times and the like."""
        files = {"weights": weights, "diagnostics": diagnostics}
        self._add(self._cell(fit), "fit", asdict(fit), fit.key, files, facts)

    def parameters(self, fit: Fit) -> bytes:
        """Returns what a stored fit has learnt, see `tasks.files.from_bytes`."""
        return (self._cell(fit) / "weights.safetensors").read_bytes()

    def diagnostics(self, folder: str) -> Parameters:
        """Returns the diagnostics of the fit in a folder that `frame` names."""
        path = self.cells / folder / "diagnostics.safetensors"
        return from_bytes(path.read_bytes()) if path.exists() else {}

    def facts(self, folder: str) -> dict[str, Any]:
        """Returns times, host and versions of the fit in a folder that `frame` names."""
        return dict(json.loads((self.cells / folder / "fit.json").read_bytes())["facts"])

    def add_times(self, row: Mapping[str, Any], seconds: Sequence[float]) -> None:
        """Stores how long the fit of a row of `frame` takes with the machine to itself."""
        record = {"folder": row["folder"], "seconds": list(seconds)}
        sealed = json.dumps(record | {"self": _digest(record)}, indent=2).encode()
        self.write(self.cells / row["folder"] / "times.json", sealed)

    # Controllers
    def has_controller(self, controller: ControllerSpec) -> bool:
        """Whether the controller is there; one that is damaged is set aside."""
        return self._record(self._controller(controller), controller.key) is not None

    def add_controller(
        self, controller: ControllerSpec, weights: bytes, facts: Mapping[str, Any]
    ) -> None:
        """Stores a controller, from the content of its file; facts are times and the like."""
        spec, files = asdict(controller), {"weights": weights}
        folder = self._controller(controller)
        self._add(folder, "controller", spec, controller.key, files, facts)

    def controller_spec(self, key: str) -> dict[str, Any]:
        """Returns the fields of the stored controller with that key.

        Raises:
            InputError: it is not there, or damaged and now set aside.
        """
        found = self._controller_spec(key)
        if found is None:
            raise InputError(f"{self.folder} has lost the controller {key}: run the study again")
        return found

    def _controller_spec(self, key: str) -> dict[str, Any] | None:
        for folder in self.controllers.glob(f"*-{key[:KEY_DIGITS]}"):
            if record := self._record(folder, key):
                return dict(record["spec"])
        return None

    def controller_weights(self, controller: ControllerSpec) -> bytes:
        """Returns the weights of a stored controller, see `tasks.files.from_bytes`."""
        return (self._controller(controller) / "weights.safetensors").read_bytes()

    # Evaluations
    def episodes(self, fit: Fit, evaluation: Evaluation) -> pd.DataFrame | None:
        """Returns the stored episodes, one row each, or None; what is damaged is set aside.

        Episodes of another version of the task or of another controller count as missing.
        """
        table = self._table(self._evaluation(fit, evaluation), fit.key)
        if table is None or _labels(table)["key"] != evaluation.key(fit):
            return None
        frame: pd.DataFrame = table.to_pandas()
        return frame

    def add_episodes(
        self, fit: Fit, evaluation: Evaluation, episodes: Episodes, keep: int = 0
    ) -> None:
        """Stores episodes, after the first ``keep`` of those that are there already.

        Those of another version of the task or of the controller are set aside.
        """
        path = self._evaluation(fit, evaluation)
        if self._others(fit, evaluation):
            self._set_aside(path, "it is of another version of the task or of the controller")
        table, non_finite = _episodes_table(episodes), list(episodes.non_finite)
        if keep:
            before = _read_table(path, fit.key)
            non_finite = [
                one for one in _non_finite(_labels(before)) if one.row < keep
            ] + non_finite
            kept = before.slice(0, keep).cast(table.schema)
            table = pa.concat_tables([kept, table]).combine_chunks()
        labels = {name: str(value) for name, value in asdict(evaluation).items()}
        labels |= {"format": str(FORMAT), "fit": fit.key, "key": evaluation.key(fit)}
        if non_finite:
            labels["non_finite"] = json.dumps([asdict(one) for one in non_finite])
        self.write(path, _sealed(table.replace_schema_metadata(labels | {"seal": _UNSEALED})))

    def _others(self, fit: Fit, evaluation: Evaluation) -> dict[str, str] | None:
        """The labels of sound episodes of another key, in the place of those of an evaluation."""
        path, key = self._evaluation(fit, evaluation), evaluation.key(fit)
        if _glance(path)[0] == key:
            return None
        table = self._table(path, fit.key)
        return None if table is None else _labels(table)

    # A glance: what seems to be there, unread
    def glimpse_fit(self, fit: Fit) -> bool:
        """Whether the fit seems to be there."""
        return (self._cell(fit) / "fit.json").exists()

    def glimpse_controller(self, controller: ControllerSpec) -> bool:
        """Whether the controller seems to be there."""
        return (self._controller(controller) / "controller.json").exists()

    def glimpse_episodes(self, fit: Fit, evaluation: Evaluation) -> int:
        """Returns how many episodes of this version of the task and controller seem to be there."""
        key, found = _glance(self._evaluation(fit, evaluation))
        return found if key == evaluation.key(fit) else 0

    # Study
    def check(self, cells: Iterable[Cell]) -> None:
        """Refuses cells whose place is taken by results of a controller that was trained otherwise.

        Raises:
            InputError: there is such a cell.
        """
        for cell in cells:
            others = self._others(cell.fit, cell.evaluation) if cell.controller else None
            spec = self._controller_spec(others["controller_key"]) if others else None
            differ = _differences(spec, asdict(cell.controller)) if spec and cell.controller else []
            if differ:
                raise InputError(
                    f"{self.folder} holds {cell.evaluation.name} of {cell.fit.label}"
                    f" with another controller ({', '.join(differ)}): choose another folder"
                )

    def ask_for(self, cells: Sequence[Cell], note: str = "") -> None:
        """Notes what is asked for, beside what was before; of one label, the last asked counts.

        Args:
            cells: whose results tables will show.
            note: what a reader of the tables must know.

        Raises:
            InputError: see `check`.
        """
        self.check(cells)
        study, notes = self.study(), self.notes()
        notes += [note] if note and note not in notes else []
        for cell in cells:
            entry = study.setdefault(cell.fit.label, {})
            if entry.get("key") != cell.fit.key:
                entry |= {"key": cell.fit.key, "evaluations": {}, "episodes": {}}
            entry["evaluations"][cell.evaluation.name] = cell.evaluation.key(cell.fit)
            entry["episodes"][cell.evaluation.name] = cell.episodes
        self.write_study(study, notes)

    def write_study(self, study: Mapping[str, Any], notes: list[str]) -> None:
        """Writes down what is asked for, in place of what was."""
        self.cells.mkdir(exist_ok=True)
        entry = {"format": FORMAT, "notes": notes, "fits": study}
        text = json.dumps(entry, indent=1, sort_keys=True)
        self.write(self.folder / "study.json", text.encode())

    def study(self) -> dict[str, Any]:
        """Returns what has been asked for, by label of fit.

        Of each its ``key``, and by name of evaluation the keys of its ``evaluations`` and how many
        ``episodes``.

        Raises:
            InputError: study.json is damaged.
        """
        return self._asked()[0]

    def notes(self) -> list[str]:
        """Returns what a reader of the tables must know.

        Raises:
            InputError: study.json is damaged.
        """
        return self._asked()[1]

    def _asked(self) -> tuple[dict[str, Any], list[str]]:
        path = self.folder / "study.json"
        if not path.exists():
            return {}, []
        try:
            return _read_study(path)
        except DamagedError as error:
            raise InputError(
                f"{path} is damaged ({error}): remove it and run the study again; what is stored"
                " will be found"
            ) from error

    def progress(self) -> dict[str, int]:
        """Returns how many results were asked for, and how many are there in full.

        Of ``controllers``, ``fits`` and ``evaluations``, and of each those ``_done``.

        Raises:
            InputError: the folder holds no results.
        """
        self._require_results()
        study = self.study()
        folders = {label: self.cells / folder_name(label, study[label]["key"]) for label in study}
        done = [
            there == key and found >= entry["episodes"].get(name, 0)
            for label, entry in study.items()
            for name, key in entry["evaluations"].items()
            for there, found in [_glance(folders[label] / f"{name}.parquet")]
        ]
        wanted = {
            controller
            for label, entry in study.items()
            for name in entry["evaluations"]
            if (controller := _controller_label(label, name))
        }
        stored = {
            path.parent.name[: -KEY_DIGITS - 1]
            for path in self.controllers.glob("*/controller.json")
        }
        return {
            "controllers": len(wanted),
            "controllers_done": len(wanted & stored),
            "fits": len(study),
            "fits_done": sum((folder / "fit.json").exists() for folder in folders.values()),
            "evaluations": len(done),
            "evaluations_done": sum(done),
        }

    def non_finite(self) -> Iterator[tuple[dict[str, Any], int, list[NonFinite]]]:
        """Yields the evaluations that were asked for in which a method's answers were not finite.

        Each with the fields of its fit, its number of episodes, and what was not finite.
        """
        for label, entry in sorted(self.study().items()):
            folder = self.cells / folder_name(label, entry["key"])
            for name in sorted(entry["evaluations"]):
                with suppress(DamagedError), _reading():
                    found = pq.read_metadata(folder / f"{name}.parquet")
                    chunks = _non_finite({k.decode(): v for k, v in found.metadata.items()})
                    record = self._record(folder, entry["key"]) if chunks else None
                    if record:
                        yield record["spec"], found.num_rows, chunks

    def frame(self) -> pd.DataFrame:
        """Returns one row for each evaluation that was asked for and is there.

        Columns: the fields of `Fit` and `Evaluation`, and ``episodes``, ``successes``,
        ``diverged``, ``fit_seconds`` (NaN unless `bench time` measured them), ``folder``.

        Raises:
            InputError: the folder holds no results.
        """
        import pandas as pd  # slow to import, and `bench status` does without

        self._require_results()
        rows = []
        for label, entry in sorted(self.study().items()):
            folder = self.cells / folder_name(label, entry["key"])
            record = self._record(folder, entry["key"])
            times = self._times(folder)
            for name, key in sorted(entry["evaluations"].items()) if record else ():
                table = self._table(folder / f"{name}.parquet", entry["key"])
                if record and table is not None and _labels(table)["key"] == key:
                    rows.append(_row(folder, record, times, table))
        return pd.DataFrame(rows, columns=COLUMNS)

    def _require_results(self) -> None:
        if not self.cells.exists():
            raise InputError(f"{self.folder} holds no results: bench run writes them there")

    def outcomes(self, row: Mapping[str, Any]) -> pd.DataFrame:
        """Returns start, success, diverged and steps of each episode of a row of `frame`."""
        import pandas as pd

        path = self.cells / row["folder"] / f"{evaluation_name(row)}.parquet"
        columns = ["start", "success", "diverged", "steps"]
        frame: pd.DataFrame = pd.read_parquet(path, columns=columns)
        return frame

    def readings(self, row: Mapping[str, Any]) -> NDArray[np.float32] | None:
        """Returns what the rule reads after each control step (B, T-1) of a row of `frame`."""
        path = self.cells / row["folder"] / f"{evaluation_name(row)}.parquet"
        column = pq.read_table(path, columns=["readings"])["readings"].combine_chunks()
        return np.asarray(column.flatten()).reshape(len(column), -1)

    # Failures
    def add_failure(self, label: str, reason: str, traceback: str, tries: int = 1) -> None:
        """Notes why there is no result of that label, and how often it was tried in all."""
        path = self._failure(label)
        before = self._unless_damaged(path, partial(_read_failure, path))
        tries += before["tries"] if before else 0
        entry = {"label": label, "tries": tries, "reason": reason, "traceback": traceback}
        path.parent.mkdir(exist_ok=True)
        self.write(path, json.dumps(entry, indent=2).encode())

    def clear_failure(self, label: str) -> None:
        """Forgets an earlier failure, now that there is a result."""
        self._failure(label).unlink(missing_ok=True)

    def failures(self) -> list[dict[str, Any]]:
        """Returns what has failed and has no result yet: label, tries, reason, traceback."""
        paths = sorted((self.folder / "failures").glob("*.json"))
        found = [self._unless_damaged(path, partial(_read_failure, path)) for path in paths]
        return [failure for failure in found if failure]

    # Writing
    def _failure(self, label: str) -> Path:
        name = hashlib.sha256(label.encode()).hexdigest()[:KEY_DIGITS]
        return self.folder / "failures" / f"{name}.json"

    def _cell(self, fit: Fit) -> Path:
        return self.cells / folder_name(fit.label, fit.key)

    def _evaluation(self, fit: Fit, evaluation: Evaluation) -> Path:
        return self._cell(fit) / f"{evaluation.name}.parquet"

    def _controller(self, controller: ControllerSpec) -> Path:
        return self.controllers / folder_name(controller.label, controller.key)

    def _add(
        self,
        folder: Path,
        kind: str,
        spec: dict[str, Any],
        key: str,
        contents: Mapping[str, bytes],
        facts: Mapping[str, Any],
    ) -> None:
        data = {f"{name}.safetensors": content for name, content in contents.items() if content}
        hashes = {name: hashlib.sha256(content).hexdigest() for name, content in data.items()}
        record = {"format": FORMAT, "key": key, "spec": spec, "facts": facts, "sha256": hashes}
        # JSON's own types, so that what is hashed here is what will be read.
        record = json.loads(json.dumps(record))
        data[f"{kind}.json"] = (json.dumps(record | {"self": _digest(record)}, indent=2)).encode()
        self.write_folder(folder, data)

    def write_folder(self, folder: Path, files: Mapping[str, bytes]) -> None:
        """Writes a folder of the results folder, all of it or nothing."""
        temporary = self.folder / ".unfinished" / folder.name
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir(parents=True)
        for name, content in files.items():
            flush(temporary / name, content)
        folder.parent.mkdir(exist_ok=True)
        temporary.rename(folder)
        sync(folder.parent)

    def write(self, path: Path, content: bytes) -> None:
        """Writes a file of the results folder, all of it or nothing."""
        temporary = self.folder / ".unfinished" / f"{path.parent.name}-{path.name}"
        temporary.parent.mkdir(exist_ok=True)
        flush(temporary, content)
        temporary.replace(path)
        sync(path.parent)

    # Reading
    def _record(self, folder: Path, key: str | None = None) -> dict[str, Any] | None:
        return self._unless_damaged(folder, lambda: _read_record(folder, key))

    def _times(self, folder: Path) -> list[float] | None:
        return self._unless_damaged(folder / "times.json", partial(_read_times, folder))

    def _table(self, path: Path, fit_key: str) -> pa.Table | None:
        return self._unless_damaged(path, lambda: _read_table(path, fit_key))

    def sweep(self) -> None:
        """Sets aside all that is damaged, whether it was asked for or not.

        Raises:
            InputError: the folder holds no results.
        """
        self._require_results()
        for folder in (*self.cells.glob("*/"), *self.controllers.glob("*/")):
            if record := self._record(folder):
                for path in folder.glob("eval-*.parquet"):
                    self._table(path, record["key"])
                self._times(folder)

    def _unless_damaged(self, path: Path, read: Callable[[], Any]) -> Any:
        """What is read from a path; None if it is not there, or damaged and now set aside."""
        if not path.exists():
            return None
        try:
            return read()
        except DamagedError as error:
            self._set_aside(path, str(error))
            return None

    def _set_aside(self, path: Path, reason: str) -> None:
        place = self.folder / "damaged"
        place.mkdir(exist_ok=True)
        target = place / f"{path.parent.name}-{path.name}-{len(list(place.iterdir()))}"
        path.rename(target)
        print(f"{path}: {reason}; set aside as {target}", file=sys.stderr)


class Source(Protocol):
    """What results can be read from."""

    def frame(self) -> pd.DataFrame:
        """See `Store.frame`."""

    def outcomes(self, row: Mapping[str, Any]) -> pd.DataFrame:
        """See `Store.outcomes`."""

    def readings(self, row: Mapping[str, Any]) -> NDArray[np.float32] | None:
        """See `Store.readings`; None where they are not kept."""

    def diagnostics(self, folder: str) -> Parameters:
        """See `Store.diagnostics`."""

    def facts(self, folder: str) -> dict[str, Any]:
        """See `Store.facts`."""

    def notes(self) -> list[str]:
        """See `Store.notes`."""

    def controller_spec(self, key: str) -> dict[str, Any]:
        """See `Store.controller_spec`."""


def episodes_table(source: Source) -> pd.DataFrame:
    """Returns all that `Store.outcomes` returns, under the names of `frame`, see `bench.load`."""
    import pandas as pd

    names = ["task", "method", "variant", "size", "demos", "seed", *CONDITIONS]
    found = source.frame()
    if found.empty:
        return pd.DataFrame(columns=[*names, "start", "success", "diverged", "steps"])
    frame = labelled(found)
    parts = [source.outcomes(row) for row in frame.to_dict("records")]
    table = pd.concat(parts, ignore_index=True)
    rows = np.repeat(np.arange(len(frame)), [len(part) for part in parts])
    labels = frame[names].astype({name: "category" for name in names if name not in NUMBERS})
    return pd.concat([labels.iloc[rows].reset_index(drop=True), table], axis=1)


def folder_name(label: str, key: str) -> str:
    """Returns the name of the folder of what has that label and key."""
    return f"{label}-{key[:KEY_DIGITS]}"


@contextmanager
def _reading(what: str = "it") -> Iterator[None]:
    """Turns whatever a damaged file gives rise to into a DamagedError."""
    try:
        yield
    except (OSError, ValueError, KeyError, TypeError, AttributeError, pa.ArrowException) as error:
        raise DamagedError(f"{what} cannot be read ({error})") from error


def _read_record(folder: Path, key: str | None = None) -> dict[str, Any]:
    """Returns fit.json or controller.json of a folder once all it says has been checked.

    Without a key, it is to have the one that its folder is named for.
    """
    path = folder / ("controller.json" if folder.parent.name == "controllers" else "fit.json")
    with _reading(path.name):
        record = dict(json.loads(path.read_bytes()))
        _check(record.pop("self") == _digest(record), path.name)
        named = folder.name.endswith(f"-{record['key'][:KEY_DIGITS]}")
        _check(named and key in (None, record["key"]), "its key")
        _check(
            all(isinstance(record[name], dict) for name in ("spec", "facts", "sha256")), path.name
        )
        for name, expected in record["sha256"].items():
            content = (folder / Path(name).name).read_bytes()
            _check(hashlib.sha256(content).hexdigest() == expected, name)
    return record


def _read_study(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Returns the fits and notes of study.json once they have been looked at."""
    with _reading():
        record = dict(json.loads(path.read_bytes()))
        fits, notes = dict(record["fits"]), list(record["notes"])
        for label, entry in fits.items():
            keys = {label: entry["key"], **entry["evaluations"]}
            sound = all(_FILE.fullmatch(name) and _KEY.fullmatch(key) for name, key in keys.items())
            counts = entry.setdefault("episodes", {})  # earlier versions did not note them
            _check(sound and all(isinstance(count, int) for count in counts.values()), label)
        _check(all(isinstance(note, str) for note in notes), "its notes")
    return fits, notes


def _read_failure(path: Path) -> dict[str, Any]:
    """Returns the label, tries, reason and traceback of a failure."""
    with _reading():
        failure = dict(json.loads(path.read_bytes()))
        texts = [failure[name] for name in ("label", "reason", "traceback")]
        sound = isinstance(failure["tries"], int) and all(isinstance(text, str) for text in texts)
    _check(sound, "its content")
    return failure


def _read_times(folder: Path) -> list[float]:
    """Returns the seconds of times.json once it has been checked."""
    with _reading():
        record = dict(json.loads((folder / "times.json").read_bytes()))
        _check(record.pop("self") == _digest(record), "its content")
        _check(record["folder"] == folder.name, "its place")
        return [float(seconds) for seconds in record["seconds"]]


def _read_table(path: Path, fit_key: str) -> pa.Table:
    """Returns stored episodes once their content has been checked."""
    with _reading():
        content = path.read_bytes()
        seals = _SEAL.findall(content)
        _check(len(seals) == 1 and seals[0] == _seal(_SEAL.sub(_UNSEALED, content)), "its content")
        table = pq.read_table(pa.BufferReader(content))
        labels = _labels(table)
        place = (labels["fit"], evaluation_name(labels), labels["format"])
        _check(place == (fit_key, path.stem, str(FORMAT)), "its place")
    return table


def _glance(path: Path) -> tuple[str, int]:
    """The key and number of stored episodes as their file has it, unchecked, or none."""
    try:
        with _reading():
            found = pq.read_metadata(path)
            return found.metadata[b"key"].decode(), found.num_rows
    except DamagedError:
        return "", 0


def _controller_label(fit_label: str, evaluation: str) -> str:
    """The label of the controller that an evaluation needs, see `ControllerSpec`; else nothing."""
    parts = evaluation.split("-")
    name = "-".join(parts[3:-1])
    if name in ("", NO_CONTROLLER):
        return ""
    tuned = name in (TUNED, ON_SUCCESSES)
    return f"{fit_label.partition('-')[0]}-{name}-{parts[2] if tuned else NOMINAL}"


def _differences(spec: Mapping[str, Any], asked: Mapping[str, Any]) -> list[str]:
    """What a stored controller was trained with otherwise than one that is asked for."""
    asked = json.loads(json.dumps(asked))
    return [
        f"its {name} {spec.get(name)}, asked for {asked[name]}"
        for name in ("demos", "config")
        if spec.get(name) != asked[name]
    ]


def _non_finite(labels: Mapping[str, Any]) -> list[NonFinite]:
    """What the labels of an evaluation say that was not finite."""
    rows = [NonFinite(**row) for row in json.loads(labels.get("non_finite", "[]"))]
    numbers = [number for one in rows for number in (one.row, one.starts, one.first)]
    _check(all(type(number) is int for number in numbers), "what was not finite")
    return rows


def _labels(table: pa.Table) -> dict[str, str]:
    return {name.decode(): value.decode() for name, value in (table.schema.metadata or {}).items()}


def _row(
    folder: Path, record: Mapping[str, Any], times: list[float] | None, table: pa.Table
) -> dict[str, Any]:
    labels = _labels(table)
    return (
        {"settings": ""}  # earlier versions did not note them
        | record["spec"]
        | {name: labels[name] for name in (*CONDITIONS, "controller_key")}
        | {
            "episodes": table.num_rows,
            "successes": int(np.sum(table["success"].to_numpy())),
            "diverged": int(np.sum(table["diverged"].to_numpy())),
            "fit_seconds": np.median(times) if times else np.nan,
            "folder": folder.name,
        }
    )


def _check(passes: bool, what: str) -> None:
    if not passes:
        raise DamagedError(f"{what} is not what was written")


def _episodes_table(episodes: Episodes) -> pa.Table:
    readings = episodes.readings.astype(np.float32)
    columns = {
        "start": pa.array(episodes.starts.index),
        "success": pa.array(episodes.success),
        "diverged": pa.array(episodes.diverged),
        "steps": pa.array(episodes.steps.astype(np.int16)),
        "readings": pa.FixedSizeListArray.from_arrays(readings.ravel(), readings.shape[1]),
    }
    return pa.table(columns)


def _sealed(table: pa.Table) -> bytes:
    """A parquet file that holds the SHA-256 of itself without it, so that it is written at once."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    content = sink.getvalue().to_pybytes()
    return _SEAL.sub(_seal(content), content)


def _seal(content: bytes) -> bytes:
    return b"sha256:" + hashlib.sha256(content).hexdigest().encode()


def _digest(record: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()
