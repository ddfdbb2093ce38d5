"""Results of several sources as one: packed into a folder, or of a run and the shipped methods."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from safetensors.numpy import save

from bench.packed import Packed, open_results, shipped
from bench.store import CONDITIONS, Source
from methods.base import Parameters
from tasks.errors import InputError

SHOWN = ("eigenvalues", "imitation_error")
"""The diagnostics that exhibits need."""


def pack(folders: Sequence[Path], out: Path) -> None:
    """Writes the results of several folders as one, in the form of `bench.packed`.

    Args:
        folders: of `bench run` or `bench pack`.
        out: folder of the files, created if needed. It may be one of the folders.

    Raises:
        InputError: there are no results, or two folders hold different results of the same fit.
    """
    sources = [open_results(folder) for folder in folders]
    results = JoinedSources([(source, source.frame()) for source in sources])
    frame = results.frame()
    if frame.empty:
        raise InputError(f"{', '.join(map(str, folders))}: no evaluations to pack")
    parts = [results.outcomes(row) for row in frame.to_dict("records")]
    rows = np.repeat(np.arange(len(frame), dtype=np.int32), [len(part) for part in parts])
    episodes = pd.concat(parts, ignore_index=True).astype({"start": np.int32})
    episodes.insert(0, "evaluation", rows)
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
    table = frame.assign(config=frame.config.map(json.dumps))
    out.mkdir(parents=True, exist_ok=True)
    # Files in out may be the only copy of a part, so they are replaced once all are written.
    with TemporaryDirectory(dir=out) as place:
        new = Path(place)
        episodes.to_parquet(new / "episodes.parquet", index=False, compression="zstd")
        table.to_parquet(new / "evaluations.parquet", index=False)
        (new / "diagnostics.safetensors").write_bytes(save(arrays))
        (new / "provenance.json").write_text(json.dumps(facts, indent=1) + "\n")
        for path in sorted(new.iterdir()):
            path.replace(out / path.name)


class JoinedSources:
    """The results of several sources as one.

    Duplicate evaluations: the one with more episodes is kept. Duplicate fits: the first available
    timing is kept.
    """

    def __init__(self, parts: Sequence[tuple[Source, pd.DataFrame]]) -> None:
        """Joins sources, each with the wanted rows of its frame.

        Raises:
            InputError: two hold different results of the same fit.
        """
        self._sources = [source for source, _ in parts]
        frames = [frame.assign(source=place) for place, (_, frame) in enumerate(parts)]
        # An empty frame would turn integers into floats.
        whole = pd.concat([f for f in frames if len(f)] or frames, ignore_index=True)
        if len(whole):
            _check_alike(whole)
            most = whole.groupby(_PLACE, sort=False).episodes.idxmax()
            whole["fit_seconds"] = whole.groupby("folder").fit_seconds.transform("first")
            whole = whole.loc[sorted(most)]
            places = whole[_PLACE].itertuples(index=False, name=None)
            self._evaluations = dict(zip(places, whole.source, strict=True))
            self._fits = _first_source(whole, "folder")
            self._controllers = _first_source(whole, "controller_key")
        self._frame = whole.drop(columns="source").reset_index(drop=True)

    def frame(self) -> pd.DataFrame:
        """See `bench.store.Store.frame`."""
        return self._frame

    def outcomes(self, row: Mapping[str, Any]) -> pd.DataFrame:
        """See `bench.store.Store.outcomes`."""
        place = tuple(row[name] for name in _PLACE)
        return self._sources[self._evaluations[place]].outcomes(row)

    def readings(self, row: Mapping[str, Any]) -> NDArray[np.float32] | None:
        """See `bench.store.Store.readings`. None if they are not stored."""
        place = tuple(row[name] for name in _PLACE)
        return self._sources[self._evaluations[place]].readings(row)

    def diagnostics(self, folder: str) -> Parameters:
        """See `bench.store.Store.diagnostics`."""
        return self._sources[self._fits[folder]].diagnostics(folder)

    def facts(self, folder: str) -> dict[str, Any]:
        """See `bench.store.Store.facts`."""
        return self._sources[self._fits[folder]].facts(folder)

    def notes(self) -> list[str]:
        """See `bench.store.Store.notes`."""
        return list(dict.fromkeys(note for source in self._sources for note in source.notes()))

    def controller_spec(self, key: str) -> dict[str, Any]:
        """See `bench.store.Store.controller_spec`."""
        return self._sources[self._controllers[key]].controller_spec(key)


class WithShippedMethods(JoinedSources):
    """The results of a run, and the shipped results of methods that it lacks."""

    def __init__(self, own: Source) -> None:
        """Joins the results of the run with the shipped ones.

        Raises:
            InputError: no results are shipped.
        """
        reference = Packed(shipped())
        mine, theirs = own.frame(), reference.frame()
        theirs = theirs[theirs.task.isin(mine.task) & ~theirs.method.isin(mine.method)]
        super().__init__([(own, mine), (reference, theirs)])
        self._own = own
        self.methods = tuple(theirs.method.unique())
        """The methods with shipped results."""

    def notes(self) -> list[str]:
        """See `bench.store.Store.notes`. A further note names the shipped methods."""
        origin = f"From another machine, as shipped: {', '.join(self.methods) or 'nothing'}."
        return [*self._own.notes(), origin]


_PLACE = ["folder", *CONDITIONS]


def _first_source(whole: pd.DataFrame, column: str) -> dict[str, int]:
    """Returns the first source with each value of a column, by value."""
    first = whole.drop_duplicates(column)
    return dict(zip(first[column], first.source, strict=True))


def _check_alike(whole: pd.DataFrame) -> None:
    """Raises InputError if rows have the same labels but different keys."""
    whole = whole.assign(label=whole.folder.str.rsplit("-", n=1).str[0])
    for by, what in ((["label"], "folder"), (_PLACE, "controller_key")):
        for names, found in whole.groupby(by)[what]:
            if found.nunique() > 1:
                raise InputError(
                    f"there are different results of {' '.join(map(str, names))}: of another"
                    " version, config, controller or set of demonstrations; pack what was run alike"
                )
