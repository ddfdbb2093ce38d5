"""Results in a small form that can be shipped: what the exhibits need, and no weights.

A folder holds::

    evaluations.parquet      one row each, as `bench.store.Store.frame` gives them
    episodes.parquet         evaluation (its row above), start, success, diverged, steps
    diagnostics.safetensors  of each fit, under "<folder>/<name>"
    provenance.json          what a reader must know, and by fit its times, host and versions
"""

import json
from collections.abc import Mapping
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from safetensors.numpy import load_file, save_file

from bench.store import CONDITIONS, Source, Store
from methods.base import Parameters
from tasks.errors import InputError

SHIPPED = Path(__file__).with_name("reference")


def pack(store: Store, folder: Path) -> None:
    """Writes the results of a run in the small form.

    Args:
        store: the results folder of the run.
        folder: where the files go, made if need be.

    Raises:
        InputError: the store holds no results.
    """
    frame = store.frame()
    if frame.empty:
        raise InputError(f"{store.folder} holds no evaluations to pack")
    folder.mkdir(parents=True, exist_ok=True)
    parts = [store.outcomes(row) for row in frame.to_dict("records")]
    rows = np.repeat(np.arange(len(frame), dtype=np.int32), [len(part) for part in parts])
    episodes = pd.concat(parts, ignore_index=True).astype({"start": np.int32})
    episodes.insert(0, "evaluation", rows)
    episodes.to_parquet(folder / "episodes.parquet", index=False, compression="zstd")
    table = frame.assign(config=frame.config.map(json.dumps))
    table.to_parquet(folder / "evaluations.parquet", index=False)
    fits = frame.folder.unique()
    arrays = {
        f"{fit}/{name}": values for fit in fits for name, values in store.diagnostics(fit).items()
    }
    save_file(arrays, folder / "diagnostics.safetensors")
    facts = {"notes": store.notes(), "fits": {fit: store.facts(fit) for fit in fits}}
    (folder / "provenance.json").write_text(json.dumps(facts, indent=1) + "\n")


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

    @cached_property
    def _evaluations(self) -> pd.DataFrame:
        frame = pd.read_parquet(self.folder / "evaluations.parquet")
        return frame.assign(config=frame.config.map(json.loads))

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
        table = pd.read_parquet(self.folder / "episodes.parquet")
        ends = np.searchsorted(table.evaluation, np.arange(1, len(self._places)))
        table = table.drop(columns="evaluation")
        bounds = [0, *ends, len(table)]
        return [table.iloc[a:b] for a, b in pairwise(bounds)]


class Beside:
    """Results of a run, and beside them the shipped ones of methods that the run has not."""

    def __init__(self, own: Source) -> None:
        """Takes the results of the run.

        Raises:
            InputError: nothing is shipped, or it is from other demonstrations than the run's.
        """
        self._own, self._shipped = own, Packed(shipped())
        mine, theirs = own.frame(), self._shipped.frame()
        theirs = theirs[theirs.task.isin(mine.task) & ~theirs.method.isin(mine.method)]
        for task, recipes in pd.concat([mine, theirs]).groupby("task").recipe:
            if recipes.nunique() > 1:
                raise InputError(
                    f"the shipped results of {task} are from other demonstrations than these: of"
                    " another expert, task or version of MuJoCo"
                )
        self._frame = pd.concat([mine, theirs], ignore_index=True)
        self._folders = frozenset(mine.folder)
        self.methods = tuple(theirs.method.unique())
        """The methods whose results are the shipped ones."""

    def frame(self) -> pd.DataFrame:
        """See `bench.store.Store.frame`."""
        return self._frame

    def outcomes(self, row: Mapping[str, Any]) -> pd.DataFrame:
        """See `bench.store.Store.outcomes`."""
        return self._of(row["folder"]).outcomes(row)

    def diagnostics(self, folder: str) -> Parameters:
        """See `bench.store.Store.diagnostics`."""
        return self._of(folder).diagnostics(folder)

    def facts(self, folder: str) -> dict[str, Any]:
        """See `bench.store.Store.facts`."""
        return self._of(folder).facts(folder)

    def notes(self) -> list[str]:
        """See `bench.store.Store.notes`; says which methods come from another machine."""
        origin = f"From another machine, as shipped: {', '.join(self.methods) or 'nothing'}."
        return [*self._own.notes(), origin]

    def _of(self, folder: str) -> Source:
        return self._own if folder in self._folders else self._shipped
