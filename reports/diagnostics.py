"""What fits have stored of themselves: KODex's eigenvalues and singular values, and errors."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from reports.results import Results
from tasks.data import FloatArray
from tasks.errors import InputError


def magnitudes(results: Results, row: Mapping[str, Any]) -> FloatArray:
    """Returns the magnitudes (p,) of the eigenvalues of K, for a row of KODex.

    Raises:
        InputError: none are stored, or they have another shape or are not finite.
    """
    folder = row["folder"]
    found = _diagnostic(results, folder, "eigenvalues")
    if found.ndim != 2 or found.shape[1] != 2 or not found.size or not np.isfinite(found).all():
        raise InputError(
            f"{folder} has stored eigenvalues of shape {found.shape}, not finite ones of (p, 2)"
        )
    return np.hypot(*found.T)


def gap(results: Results, folder: str) -> tuple[int, int, float, float]:
    """Returns what a fit of KODex heeds: p, the rank, and the gap in the singular values.

    The gap has two ends, relative to the largest value: the last that counts, and the next (0
    if all count).

    Raises:
        InputError: no singular values or no rank are stored, or they do not fit together.
    """
    values = _diagnostic(results, folder, "singular_values")
    rank = _diagnostic(results, folder, "rank")
    if rank.shape or values.ndim != 1 or not 0 < rank <= len(values):
        raise InputError(
            f"{folder} has stored {values.shape} singular values and rank {rank}, not (p,) and"
            " a number up to p"
        )
    last, following = [*values, 0.0][int(rank) - 1 : int(rank) + 1]
    return len(values), int(rank), float(last / values[0]), float(following / values[0])


def imitation_error(results: Results, folder: str) -> float:
    """Returns the mean over joints of a fit's stored imitation error.

    Raises:
        InputError: none is stored.
    """
    return float(_diagnostic(results, folder, "imitation_error").mean())


def _diagnostic(results: Results, folder: str, name: str) -> FloatArray:
    found = results.diagnostics(folder)
    if name not in found:
        raise InputError(f"{folder} has stored no {name.replace('_', ' ')}")
    return found[name]
