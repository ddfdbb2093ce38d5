"""Refuses to mix results of pinned kernels with others, whose last bits differ."""

from collections.abc import Iterable
from pathlib import Path

from bench.results import Results
from tasks.errors import InputError
from tasks.pins import SWITCH, UNPINNED, mark, pin


def check_kernels(results: Results) -> None:
    """Checks that stored results were computed with kernels marked as those of this process.

    Raises:
        InputError: some were not.
    """
    found = refusal(results)
    if found:
        raise InputError(found)


def refusal(results: Results) -> str:
    """Returns why `check_kernels` refuses stored results, or an empty text."""
    found = results.marks()
    if found <= {mark()}:
        return ""
    switch = f", or set {SWITCH}=off" if found == {UNPINNED} else ""
    return f"{results.folder} holds results of {unlike(found)}: choose another folder{switch}"


def unlike(found: Iterable[str]) -> str:
    """Returns how kernels with some marks differ from those of this process."""
    reason = pin().why_not and f" ({pin().why_not})"
    return f"kernels marked {', '.join(sorted(found))}, and here they are marked {mark()}{reason}"


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
