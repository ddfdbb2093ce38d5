"""Fitted methods, loaded from a results folder."""

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from bench.labels import labelled
from bench.manifest import Name
from bench.names import KEY_DIGITS
from bench.results import Results
from bench.selection import best_validated
from bench.spec import EXPERT, VALIDATION
from bench.verify import fit_of
from methods.base import Method
from methods.contract import loaded
from methods.registry import get_method
from tasks.errors import InputError, unknown_name
from tasks.registry import get_task


class NoMethodError(InputError, KeyError):
    """There are no fits of a method."""

    __str__ = Exception.__str__


class Methods(Mapping[str, Method]):
    """Fitted methods of a task by label, see `bench.labels`; each is loaded when it is looked up.

    Raises:
        InputError: on look-up, if there is no fit of that method, seed or size, or if another
            version of the method than the installed one made it.
    """

    def __init__(
        self, results: Results, frame: pd.DataFrame, task: str, seed: int | None, size: str | None
    ) -> None:
        """Takes results and their frame, see `bench.opened.Opened.methods`.

        Raises:
            InputError: there are no fits of that task.
        """
        fitted = labelled(frame[(frame.method != EXPERT) & (frame.variant == "described")])
        self._rows = fitted[fitted.task == task]
        if self._rows.empty:
            raise unknown_name("task of these results", task, fitted.task.unique())
        self._results, self._seed, self._size = results, seed, size

    def __getitem__(self, name: str) -> Method:
        if name not in self:
            raise NoMethodError(str(unknown_name("method of these results", name, self)))
        return _load(self._results, self._row(name))

    def __contains__(self, name: object) -> bool:
        return name in set(self._rows.method)

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows.method.unique().tolist())

    def __len__(self) -> int:
        return int(self._rows.method.nunique())

    def __repr__(self) -> str:
        return f"<fitted methods: {', '.join(self)}>"

    def _row(self, name: str) -> dict[str, Any]:
        rows = self._rows[self._rows.method == name]
        rows = rows[rows.demos == rows.demos.max()]
        sizes = rows["size"].unique().tolist()
        size = self._size or best_validated(rows[rows.split == VALIDATION], sizes)
        rows = rows[rows["size"] == size]
        if rows.empty:
            raise unknown_name(f"size of {name} in these results", size, sizes)
        seeds = sorted(rows.seed.unique())
        seed = seeds[0] if self._seed is None else self._seed
        rows = rows[rows.seed == seed]
        if rows.empty:
            raise unknown_name(f"seed of {name} in these results", seed, map(str, seeds))
        return dict(rows.to_dict("records")[0])


def _load(results: Results, row: Mapping[str, Any]) -> Method:
    fit = fit_of(row)
    label, _, digits = str(row["folder"]).rpartition("-")  # the label of when it was stored
    if digits != fit.key[:KEY_DIGITS]:
        raise InputError(
            f"{row['folder']} was fitted by another version of {fit.method} than the installed"
            " one: run the study again"
        )
    method, layout = get_method(fit.method, fit.variant), get_task(fit.task).layout
    return loaded(method, fit.config, layout, results.parameters(Name(label, fit.key)))
