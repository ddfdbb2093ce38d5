"""Results in a small form that can be shipped: what the exhibits need, and no weights.

A folder holds::

    evaluations.parquet      one row each, as `bench.store.Store.frame` gives them
    episodes.parquet         evaluation (its row above), start, success, diverged, steps
    diagnostics.safetensors  of each fit those that exhibits show, under "<folder>/<name>"
    provenance.json          what a reader must know, by fit its times, host and versions, and by
                             key what the controllers have learnt from

`bench pack` writes it, see `reports.reference`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from safetensors.numpy import load_file

from bench.store import CONDITIONS, Source, Store
from tasks.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

    from methods.base import Parameters

SHIPPED = Path(__file__).parents[1] / "reports" / "reference"
"""The folder of the results that are shipped."""


def open_results(folder: Path) -> Source:
    """Returns the results in a folder of `bench run` or `bench pack`."""
    return Packed(folder) if is_packed(folder) else Store(folder)


def shipped() -> Path:
    """Returns the folder of the shipped results.

    Raises:
        InputError: none are.
    """
    if not is_packed(SHIPPED):
        raise InputError("no reference results are shipped with this version")
    return SHIPPED


def is_packed(folder: Path) -> bool:
    """Whether a folder holds results in the small form."""
    return (folder / "evaluations.parquet").exists()


class Packed:
    """Results in the small form, read as a `bench.store.Store` is."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def frame(self) -> pd.DataFrame:
        """See `bench.store.Store.frame`."""
        return self._evaluations

    def outcomes(self, row: Mapping[str, Any]) -> pd.DataFrame:
        """See `bench.store.Store.outcomes`."""
        place = tuple(row[name] for name in ("folder", *CONDITIONS))
        return self._episodes[self._places[place]].reset_index(drop=True)

    def readings(self, row: Mapping[str, Any]) -> None:
        """Returns None: they are not packed."""

    def diagnostics(self, folder: str) -> Parameters:
        """See `bench.store.Store.diagnostics`."""
        found = (name.split("/", 1) for name in self._arrays)
        return {name: self._arrays[f"{fit}/{name}"] for fit, name in found if fit == folder}

    def facts(self, folder: str) -> dict[str, Any]:
        """See `bench.store.Store.facts`."""
        return dict(self._provenance["fits"][folder])

    def notes(self) -> list[str]:
        """See `bench.store.Store.notes`."""
        return list(self._provenance["notes"])

    def controller_spec(self, key: str) -> dict[str, Any]:
        """See `bench.store.Store.controller_spec`."""
        return dict(self._provenance["controllers"][key])

    @cached_property
    def _evaluations(self) -> pd.DataFrame:
        import pandas as pd

        frame = pd.read_parquet(self.folder / "evaluations.parquet")
        settings = frame.get("settings", "")  # earlier versions did not note them
        return frame.assign(config=frame.config.map(json.loads), settings=settings)

    @cached_property
    def _provenance(self) -> dict[str, Any]:
        return dict(json.loads((self.folder / "provenance.json").read_bytes()))

    @cached_property
    def _arrays(self) -> Parameters:
        return load_file(self.folder / "diagnostics.safetensors")

    @cached_property
    def _places(self) -> dict[tuple[str, ...], int]:
        frame = self._evaluations
        columns = (frame[name] for name in ("folder", *CONDITIONS))
        return {place: row for row, place in enumerate(zip(*columns, strict=True))}

    @cached_property
    def _episodes(self) -> list[pd.DataFrame]:
        import pandas as pd

        table = pd.read_parquet(self.folder / "episodes.parquet")
        ends = np.searchsorted(table.evaluation, np.arange(1, len(self._places)))
        table = table.drop(columns="evaluation").astype({"start": np.int64})
        bounds = [0, *ends, len(table)]
        return [table.iloc[a:b] for a, b in pairwise(bounds)]
