"""Whether results have the same bits that must have the same: equal keys, pins and versions."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bench.manifest import Name, Wanted
from bench.names import evaluation_label
from bench.provenance import same_bits
from bench.results import Results
from bench.stored_files import software_of
from tasks.files import from_bytes
from tasks.simulator import CHUNK


@dataclass(frozen=True)
class _Learnt:
    """How a kind of what is learnt is read from results."""

    title: str
    """Text before a label."""
    has: Callable[[Results, Name], bool]
    facts: Callable[[Results, Name], dict[str, Any]]
    weights: Callable[[Results, Name], bytes]


_CONTROLLER = _Learnt(
    "controller ", Results.has_controller, Results.controller_facts, Results.controller_weights
)
_FIT = _Learnt("", Results.has_fit, Results.fit_facts, Results.parameters)


def first_difference(one: Results, other: Results, wanted: Wanted) -> str:
    """Returns where two folders differ in what must be the same of an evaluation, or nothing.

    Compared are controller, fit and episodes, each if both folders have it and its software was the
    same and pinned, see `tasks.pins`.
    """
    learnt = [(_CONTROLLER, name) for name in wanted.controllers]
    learnt += [(_FIT, wanted.fit)] if wanted.fitted else []
    found = (_learnt_differ(one, other, kind, name) for kind, name in learnt)
    return next(filter(None, found), "") or _evaluations_differ(one, other, wanted)


def _learnt_differ(one: Results, other: Results, kind: _Learnt, name: Name) -> str:
    both = one, other
    if not all(kind.has(results, name) for results in both):
        return ""
    if not same_bits(*(kind.facts(results, name) for results in both)):
        return ""
    found = weights_differ(*(kind.weights(results, name) for results in both))
    return found and f"{kind.title}{name.label}: {found}"


def _evaluations_differ(one: Results, other: Results, wanted: Wanted) -> str:
    frames = one.episodes(wanted), other.episodes(wanted)
    if frames[0] is None or frames[1] is None:
        return ""
    made = [software_of(results.evaluation_labels(wanted)) for results in (one, other)]
    if any(len(part) != 1 for part in made) or not same_bits(made[0][0], made[1][0]):
        return ""
    found = episodes_differ(frames[0], frames[1])
    return found and f"{evaluation_label(wanted.fit, wanted.evaluation.label)}: {found}"


def weights_differ(one: bytes, other: bytes) -> str:
    """Returns the first number in which two safetensors files differ, or nothing."""
    first, second = from_bytes(one), from_bytes(other)
    for name in sorted({*first, *second}):
        if name not in first or name not in second:
            return f"only one of them has {name}"
        a, b = first[name], second[name]
        if (a.shape, a.dtype) != (b.shape, b.dtype):
            return f"{name} is {a.dtype} {a.shape} in one, {b.dtype} {b.shape} in the other"
        places = np.argwhere(_unequal(a, b))
        if places.size:
            place = tuple(map(int, places[0]))
            return f"{name}{list(place)} is {a[place]} in one, {b[place]} in the other"
    return ""


def episodes_differ(one: pd.DataFrame, other: pd.DataFrame) -> str:
    """Returns the first episode in which two evaluations differ, or nothing.

    A policy meets `CHUNK` starts at once, and its answers may depend on all of them. So only chunks
    that both have whole are compared.
    """
    count = min(len(one), len(other))
    if len(one) != len(other):
        count -= count % CHUNK
    if not count:
        return ""
    for column in one.columns.intersection(other.columns):
        a, b = (_stacked(frame[column].iloc[:count]) for frame in (one, other))
        rows = np.flatnonzero(_unequal(a, b).reshape(count, -1).any(axis=1))
        if rows.size:
            row = int(rows[0])
            step = np.flatnonzero(_unequal(np.atleast_1d(a[row]), np.atleast_1d(b[row])))[0]
            x, y = np.atleast_1d(a[row])[step], np.atleast_1d(b[row])[step]
            place = column if a.ndim == 1 else f"{column}[{step}]"
            return f"{place} of episode {row} is {x} in one, {y} in the other"
    return ""


def _stacked(column: Iterable[Any]) -> NDArray[Any]:
    return np.stack(list(column))


def _unequal(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.bool_]:
    """Where numbers differ; NaN equals NaN."""
    return np.asarray((a != b) & ((a == a) | (b == b)))
