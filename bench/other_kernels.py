"""Refuses to mix results of pinned kernels with others, whose last bits differ."""

from collections.abc import Iterable
from pathlib import Path

from bench.results import Results
from tasks.errors import InputError
from tasks.pins import mark, pin


def check_kernels(results: Results) -> None:
    """Checks that stored results were computed with kernels marked as those of this process.

    Raises:
        InputError: some were not.
    """
    for found in results.marks() - {mark()}:
        reason = pin().why_not or "bench doctor shows how"
        raise InputError(
            f"{results.folder} holds results of kernels marked {found}, and here they are marked"
            f" {mark()} ({reason}): choose another folder"
        )


def check_alike(marks: Iterable[tuple[Path, Iterable[str]]]) -> None:
    """Checks that results of several folders have the same mark.

    Raises:
        InputError: they do not.
    """
    first: dict[str, Path] = {}
    for folder, found in marks:
        for one in found:
            first.setdefault(one, folder)
    if len(first) > 1:
        shown = ", ".join(f"{one} in {folder}" for one, folder in first.items())
        raise InputError(
            f"results of differently marked kernels are not put together: {shown}; bench doctor"
            " shows the kernels of a machine"
        )
