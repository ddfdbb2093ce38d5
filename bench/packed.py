"""Packed results: a small form to share, with what exhibits need and without weights.

`bench pack` writes a folder with these files::

    evaluations.parquet      a row for each evaluation, see `bench.source.Source.frame`
    episodes.parquet         evaluation (number of its row above), start, success, diverged, steps
    diagnostics.safetensors  diagnostics that exhibits show, as "<folder of the fit>/<name>"
    provenance.json          notes for readers; times, host and versions of fits; fields of
                             controllers by key; the SHA-256 of all files
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow.parquet as pq
from safetensors.numpy import load, save

from bench.combined import CombinedResults
from bench.names import CONDITIONS
from bench.other_kernels import check_alike
from bench.results import Results
from bench.sealed_files import DamagedError, read_content, read_record, seal_folder
from bench.source import Source, numbered_outcomes, outcomes_by_row
from bench.stored_files import DIAGNOSTICS
from bench.submission import Submission
from tasks.errors import InputError
from tasks.files import whole_file

if TYPE_CHECKING:
    import pandas as pd

    from methods.base import Parameters

SHIPPED = Path(__file__).parents[1] / "reports" / "reference"
"""Folder of the shipped results."""
EVALUATIONS, EPISODES = "evaluations.parquet", "episodes.parquet"
PROVENANCE = "provenance.json"
SHOWN = ("eigenvalues", "imitation_error", "singular_values", "rank")
"""The diagnostics that exhibits show."""


def open_results(place: Path) -> Source:
    """Returns the results of a folder of `bench run` or `bench pack`, or a file of `bench submit`.

    Raises:
        InputError: a file is none of `bench submit`, or damaged.
    """
    if place.is_file():
        return Submission(place)
    return Packed(place) if is_packed(place) else Results(place)


def shipped() -> Path:
    """Returns the folder of the shipped results.

    Raises:
        InputError: this version ships none.
    """
    if not is_packed(SHIPPED):
        raise InputError("no reference results are shipped with this version")
    return SHIPPED


def is_packed(folder: Path) -> bool:
    """Whether a folder holds packed results."""
    return (folder / EVALUATIONS).exists()


class Packed:
    """Packed results, for reading. Every file is checked before it is used.

    All methods raise InputError if a file is damaged.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def frame(self) -> pd.DataFrame:
        """See `bench.source.Source.frame`."""
        return self._evaluations

    def outcomes(self, row: Mapping[str, Any]) -> pd.DataFrame:
        """See `bench.source.Source.outcomes`."""
        place = tuple(row[name] for name in ("folder", *CONDITIONS))
        return self._episodes[self._places[place]].reset_index(drop=True)

    def readings(self, row: Mapping[str, Any]) -> None:
        """Returns None: readings are not packed."""

    def diagnostics(self, folder: str) -> Parameters:
        """See `bench.source.Source.diagnostics`."""
        found = (name.split("/", 1) for name in self._arrays)
        return {name: self._arrays[f"{fit}/{name}"] for fit, name in found if fit == folder}

    def facts(self, folder: str) -> dict[str, Any]:
        """See `bench.source.Source.facts`."""
        return dict(self._provenance["fits"][folder])

    def notes(self) -> list[str]:
        """See `bench.source.Source.notes`."""
        return list(self._provenance["notes"])

    def controller_spec(self, key: str) -> dict[str, Any]:
        """See `bench.source.Source.controller_spec`."""
        return dict(self._provenance["controllers"][key])

    @cached_property
    def _evaluations(self) -> pd.DataFrame:
        frame: pd.DataFrame = pq.read_table(BytesIO(self._content(EVALUATIONS))).to_pandas()
        return frame.assign(config=frame.config.map(json.loads))

    @cached_property
    def _provenance(self) -> dict[str, Any]:
        with _readable():
            return read_record(self.folder / PROVENANCE)

    @cached_property
    def _arrays(self) -> Parameters:
        return load(self._content(DIAGNOSTICS))

    @cached_property
    def _places(self) -> dict[tuple[str, ...], int]:
        frame = self._evaluations
        columns = (frame[name] for name in ("folder", *CONDITIONS))
        return {place: row for row, place in enumerate(zip(*columns, strict=True))}

    @cached_property
    def _episodes(self) -> list[pd.DataFrame]:
        table = pq.read_table(BytesIO(self._content(EPISODES))).to_pandas()
        return outcomes_by_row(table, len(self._places))

    def _content(self, file: str) -> bytes:
        with _readable():
            return read_content(self.folder, self._provenance, file)


@contextmanager
def _readable() -> Iterator[None]:
    try:
        yield
    except DamagedError as error:
        raise InputError(f"{error}: pack the results again") from error


def pack(folders: Sequence[Path], out: Path) -> None:
    """Packs the results of one or several folders into one.

    Args:
        folders: folders of `bench run` or `bench pack`.
        out: folder of the packed results, created if needed; it may be a packed one of the folders.

    Raises:
        InputError: a folder holds no results, or results that differ from another folder's, or
            kernels that are marked differently; or `out` holds results of `bench run`.
    """
    if (out / "cells").exists():
        raise InputError(f"{out} holds results of `bench run`: pack into another folder")
    sources = [open_results(folder) for folder in folders]
    frames = [source.frame() for source in sources]
    check_alike((place, found.pins) for place, found in zip(folders, frames, strict=True))
    results = CombinedResults(list(zip(sources, frames, strict=True)))
    frame = results.frame()
    if frame.empty:
        raise InputError(f"{', '.join(map(str, folders))}: no evaluations to pack")
    episodes = numbered_outcomes(results, frame)
    fits = frame.folder.unique()
    arrays = {
        f"{fit}/{name}": values
        for fit in fits
        for name, values in results.diagnostics(fit).items()
        if name in SHOWN
    }
    keys = [key for key in frame.controller_key.unique() if key]
    facts = {
        "notes": results.notes(),
        "fits": {fit: results.facts(fit) for fit in fits},
        "controllers": {key: results.controller_spec(key) for key in keys},
    }
    contents = {
        EPISODES: _parquet(episodes),
        EVALUATIONS: _parquet(frame.assign(config=frame.config.map(json.dumps))),
        DIAGNOSTICS: save(arrays),
    }
    out.mkdir(parents=True, exist_ok=True)
    with ExitStack() as written:  # all are whole before the first replaces another
        for name, content in seal_folder(PROVENANCE, facts, contents).items():
            written.enter_context(whole_file(out / name)).write_bytes(content)


def _parquet(frame: pd.DataFrame) -> bytes:
    return bytes(frame.to_parquet(index=False, compression="zstd"))
