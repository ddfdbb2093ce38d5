"""Options, arguments and exit codes that several commands share."""

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from bench.parsing import whole_number
from tasks.errors import InputError

USAGE_ERROR, SOME_FAILED = 2, 3

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
TaskName = Annotated[str, typer.Argument(help="Name of a task, such as door; see `bench list`.")]
Jobs = Annotated[
    int | None,
    typer.Option(
        help="Parallel processes; -1 for one per core. Default: BENCH_JOBS, else one per core."
    ),
]


def number(least: int, text: str) -> Any:
    """Returns a typer option that takes a whole number, see `bench.parsing.whole_number`.

    Args:
        least: the smallest number allowed.
        text: help text of the option.
    """

    def parse(given: Any) -> int:
        try:
            return whole_number(str(given), least)
        except InputError as error:
            raise typer.BadParameter(str(error)) from error

    return typer.Option(parser=parse, metavar="NUMBER", help=text)


def holds_results(folder: Path) -> bool:
    """Returns whether a folder holds what `bench run` or `bench pack` writes."""
    return any(os.path.exists(folder / name) for name in ("evaluations.parquet", "cells"))


def results_folder(folder: Path, packed: bool = False) -> Path:
    """Returns a results folder after checking that it holds results. Creates nothing.

    Args:
        folder: of `bench run`.
        packed: whether a folder of `bench pack` is accepted too.

    Raises:
        InputError: it does not exist, is a file, or holds no results of that kind.
    """
    wanted = "name a results folder of `bench run`" + " or `bench pack`" * packed
    if not os.path.lexists(folder):
        raise InputError(f"{folder} does not exist: {wanted}")
    if not os.path.isdir(folder):
        raise InputError(f"{folder} is not a folder: {wanted}")
    small = os.path.exists(folder / "evaluations.parquet")
    if small and not packed:
        raise InputError(
            f"{folder} holds results of `bench pack`, without the fits that this command needs:"
            " name a results folder of `bench run`"
        )
    if not holds_results(folder):
        raise InputError(f"{folder} holds no results: `bench run` writes them, with --out")
    return folder
