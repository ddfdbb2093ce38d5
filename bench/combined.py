"""Combines several sources of results into one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bench.names import CONDITIONS
from bench.source import TIMES, Source
from tasks.errors import InputError

if TYPE_CHECKING:  # pandas is slow to import
    import pandas as pd

    from methods.base import Parameters

_PLACE = ["folder", *CONDITIONS]
"""Columns that name an evaluation."""


class CombinedResults:
    """The results of several sources as one, itself a `Source`.

    Duplicate evaluations: the one with more episodes is kept. Duplicate fits: the first measured
    time is kept.
    """

    def __init__(self, parts: Sequence[tuple[Source, pd.DataFrame]]) -> None:
        """Takes sources, each with the rows of its frame to include.

        Raises:
            InputError: two sources hold different results under the same label.
        """
        import pandas as pd

        self._sources = [source for source, _ in parts]
        frames = [frame.assign(source=place) for place, (_, frame) in enumerate(parts)]
        # An empty frame would turn whole numbers into floats.
        whole = pd.concat([f for f in frames if len(f)] or frames, ignore_index=True)
        if len(whole):
            _check_alike(whole)
            most = whole.groupby(_PLACE, sort=False).episodes.idxmax()
            whole[[*TIMES]] = whole.groupby("folder")[[*TIMES]].transform("first")
            whole = whole.loc[sorted(most)]
            places = whole[_PLACE].itertuples(index=False, name=None)
            self._evaluations = dict(zip(places, whole.source, strict=True))
            self._fits = _first_source(whole, "folder")
            self._controllers = _first_source(whole, "controller_key")
        self._frame = whole.drop(columns="source").reset_index(drop=True)

    def frame(self) -> pd.DataFrame:
        """See `bench.source.Source.frame`."""
        return self._frame

    def outcomes(self, row: Mapping[str, Any]) -> pd.DataFrame:
        """See `bench.source.Source.outcomes`."""
        place = tuple(row[name] for name in _PLACE)
        return self._sources[self._evaluations[place]].outcomes(row)

    def readings(self, row: Mapping[str, Any]) -> NDArray[np.float32] | None:
        """See `bench.source.Source.readings`."""
        place = tuple(row[name] for name in _PLACE)
        return self._sources[self._evaluations[place]].readings(row)

    def diagnostics(self, folder: str) -> Parameters:
        """See `bench.source.Source.diagnostics`."""
        return self._sources[self._fits[folder]].diagnostics(folder)

    def facts(self, folder: str) -> dict[str, Any]:
        """See `bench.source.Source.facts`."""
        return self._sources[self._fits[folder]].facts(folder)

    def notes(self) -> list[str]:
        """See `bench.source.Source.notes`."""
        return list(dict.fromkeys(note for source in self._sources for note in source.notes()))

    def controller_spec(self, key: str) -> dict[str, Any]:
        """See `bench.source.Source.controller_spec`."""
        return self._sources[self._controllers[key]].controller_spec(key)


def _first_source(whole: pd.DataFrame, column: str) -> dict[str, int]:
    """The first source that has each value of a column."""
    first = whole.drop_duplicates(column)
    return dict(zip(first[column], first.source, strict=True))


def _check_alike(whole: pd.DataFrame) -> None:
    """Raises InputError if results of one label differ in key, or an evaluation in controller."""
    whole = whole.assign(label=whole.folder.str.rsplit("-", n=1).str[0])
    for by, what in ((["label"], "folder"), (_PLACE, "controller_key")):
        for names, found in whole.groupby(by)[what]:
            if found.nunique() > 1:
                raise InputError(
                    f"there are different results of {' '.join(map(str, names))}: the version,"
                    " config, controller or demonstrations differ; pack only results with the same"
                    " settings"
                )
