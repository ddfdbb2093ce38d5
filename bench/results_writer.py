"""Writes results folders: one process at a time, and every file whole or not at all."""

import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import pyarrow as pa
from filelock import FileLock, Timeout

from bench.manifest import Manifest, Name, Wanted
from bench.names import (
    MANIFEST,
    Named,
    cell_path,
    controller_path,
    evaluation_label,
    evaluation_path,
    failure_path,
)
from bench.results import Results, Stamp
from bench.sealed_files import write_file, write_folder
from bench.stored_files import (
    CONTROLLER,
    DIAGNOSTICS,
    FIT,
    TIMES,
    WEIGHTS,
    Times,
    episodes_to_table,
    non_finite_of,
    seal_evaluation,
    seal_failure,
    seal_learnt,
    seal_times,
    software_of,
)
from tasks.errors import InputError
from tasks.files import writable_folder

if TYPE_CHECKING:  # writing results needs neither the methods nor MuJoCo
    from bench.computing import Evaluated
    from bench.spec import ControllerSpec, Evaluation, Fit

_UNFINISHED = ".unfinished"
LONGEST = 200
"""Characters of a name in ``damaged/``, besides those that make it unique."""


@contextmanager
def writing(folder: Path) -> Iterator["ResultsWriter"]:
    """Yields the writer of a results folder, created if needed, and keeps other writers out.

    Unfinished files of an earlier writer are removed. Files that were found damaged are set aside
    at the end, if not before.

    Raises:
        InputError: another process writes to the folder, or it cannot be written to.
    """
    writable_folder(folder).mkdir(parents=True, exist_ok=True)
    try:
        with FileLock(folder / ".lock", timeout=0):
            shutil.rmtree(folder / _UNFINISHED, ignore_errors=True)
            writer = ResultsWriter(folder)
            yield writer
            writer.set_aside_damage()
    except Timeout as error:
        raise InputError(f"another run is writing to {folder.absolute()}: wait for it") from error


class ResultsWriter:
    """Writes results. Use `writing` to get one."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.absolute()  # the working folder may change
        self.results: Results = _OfWriter(folder)
        """The results stored so far."""

    def ask_for(self, wanted: Iterable[Wanted], note: str = "") -> None:
        """Adds to the manifest, see `bench.manifest.Manifest.extended`."""
        self.write_manifest(self.results.manifest().extended(wanted, note))

    def write_manifest(self, manifest: Manifest) -> None:
        """Replaces the manifest."""
        (self.folder / "cells").mkdir(exist_ok=True)
        self.write(self.folder / MANIFEST, manifest.to_bytes())

    def add_fit(
        self, fit: "Fit", weights: bytes, diagnostics: bytes, facts: Mapping[str, Any]
    ) -> None:
        """Stores a fit.

        Args:
            fit: the fit.
            weights: content of a safetensors file; empty for the expert.
            diagnostics: content of a safetensors file, or empty.
            facts: times, host and versions.
        """
        contents = {WEIGHTS: weights, DIAGNOSTICS: diagnostics}
        files = seal_learnt(FIT, fit, fit.stored, contents, facts)
        self.write_fit(fit, files)

    def add_controller(
        self, controller: "ControllerSpec", weights: bytes, facts: Mapping[str, Any]
    ) -> None:
        """Stores a controller, see `add_fit`."""
        spec, contents = asdict(controller), {WEIGHTS: weights}
        files = seal_learnt(CONTROLLER, controller, spec, contents, facts)
        self.write_controller(controller, files)

    def write_fit(self, fit: Named, files: Mapping[str, bytes]) -> None:
        """Writes the files of a fit, which then is no failure any more."""
        self.write_folder(cell_path(self.folder, fit), files)
        self.clear_failure(fit.label)

    def write_controller(self, controller: Named, files: Mapping[str, bytes]) -> None:
        """Writes the files of a controller, which then is no failure any more."""
        self.write_folder(controller_path(self.folder, controller), files)
        self.clear_failure(controller.label)

    def add_times(self, folder: str, times: Times) -> None:
        """Stores the times of the fit in a folder that `Results.frame` names."""
        self.write(self.folder / "cells" / folder / TIMES, seal_times(folder, times))

    def add_episodes(
        self, fit: "Fit", evaluation: "Evaluation", made: "Evaluated", keep: int = 0
    ) -> None:
        """Stores episodes of a stored fit.

        Args:
            fit: the fit that was evaluated.
            evaluation: its conditions.
            made: new episodes, which follow the kept ones and replace all others.
            keep: number of stored episodes to keep, from the first.
        """
        key = evaluation.key(fit)
        wanted = Wanted(Name(fit.label, fit.key), Name(evaluation.name, key), keep)
        table, non_finite = episodes_to_table(made.episodes), list(made.episodes.non_finite)
        made_with = [made.software]
        if keep:
            path = evaluation_path(self.folder, fit, evaluation.name)
            kept = self.results.table(path).slice(0, keep).cast(table.schema)
            table = pa.concat_tables([kept, table]).combine_chunks()
            labels = self.results.evaluation_labels(wanted)
            non_finite = [one for one in non_finite_of(labels) if one.row < keep] + non_finite
            made_with = [one for one in software_of(labels) if one not in made_with] + made_with
        content = seal_evaluation(fit.key, key, evaluation, table, non_finite, made_with)
        self.write_evaluation(wanted, content)

    def write_evaluation(self, wanted: Wanted, content: bytes) -> None:
        """Writes an evaluation's file, which then is no failure any more.

        Sets aside a damaged one, or one of another version.
        """
        path = evaluation_path(self.folder, wanted.fit, wanted.evaluation.label)
        if path.exists() and not self.results.stored_episodes(wanted):
            self._set_aside(path, "it is of another version of the task or of the controller")
        self.write(path, content)
        self.clear_failure(evaluation_label(wanted.fit, wanted.evaluation.label))

    def add_failure(self, label: str, reason: str, traceback: str, tries: int = 1) -> None:
        """Stores why the job of that label failed; numbers of tries add up."""
        total = tries + self.results.tries(label)
        path = failure_path(self.folder, label)
        path.parent.mkdir(exist_ok=True)
        self.write(path, seal_failure(label, total, reason, traceback))

    def clear_failure(self, label: str) -> None:
        """Removes the failure of that label, if there is one."""
        failure_path(self.folder, label).unlink(missing_ok=True)

    def set_aside_damage(self) -> None:
        """Moves everything that has been found damaged to ``damaged/``; says on stderr where.

        Failures and times are checked first, since a run need not have read them.
        """
        self.results.failures()
        for path in (self.folder / "cells").glob("*"):
            self.results.times(path.name)
        for path in list(self.results.damaged):
            self._set_aside(path)

    def write(self, path: Path, content: bytes) -> None:
        """Writes a file of the results folder, whole or not at all; sets aside a damaged one."""
        if path in self.results.damaged:
            self._set_aside(path)
        write_file(path, content, self.folder / _UNFINISHED)

    def write_folder(self, folder: Path, files: Mapping[str, bytes]) -> None:
        """Writes a subfolder, whole or not at all; sets aside an existing one."""
        if folder.exists():
            self._set_aside(folder)
        write_folder(folder, files, self.folder / _UNFINISHED)

    def _set_aside(self, path: Path, reason: str = "it has been replaced") -> None:
        """Moves a path to ``damaged/`` if it is there; the reason is for one that is sound."""
        reason = self.results.damaged.pop(path, reason)
        if not path.exists():
            return
        place = self.folder / "damaged"
        place.mkdir(exist_ok=True)
        name = f"{path.parent.name}-{path.name}"[-LONGEST:]
        target = place / f"{name}-{uuid4().hex[:8]}"
        path.rename(target)
        print(f"{path}: {reason}; set aside as {target}", file=sys.stderr)


class _OfWriter(Results):
    """Results whose damage is reported when it is set aside."""

    def report(self, path: Path, stamp: Stamp, reason: str) -> None:
        """Says nothing."""
