"""Parses values of the command line: lists of names, whole numbers, seeds and settings."""

import json
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

from tasks.errors import InputError, unknown_name
from tasks.files import path_of

LARGEST = 999_999_999
"""Largest whole number that an option accepts."""
MOST_SEEDS = 10_000
_SEEDS = re.compile(r"([0-9]{1,9})(?:\s*-\s*([0-9]{1,9}))?")
_WHOLE = re.compile(r"[+-]?[0-9]+(_[0-9]+)*")


def names(option: str, text: str) -> tuple[str, ...]:
    """Returns the names in a comma-separated list, each once, in the order given.

    Spaces around a name and empty entries are ignored.

    Args:
        option: name for the message, such as ``--tasks``.
        text: the list.

    Raises:
        InputError: the list is empty.
    """
    found = dict.fromkeys(name for part in text.split(",") if (name := part.strip()))
    if not found:
        raise InputError(f"{option} takes names separated by commas, got {text!r}")
    return tuple(found)


def known_names(option: str, kind: str, text: str, known: Iterable[str]) -> tuple[str, ...]:
    """Returns the names in a comma-separated list, each once, in the order of the known names.

    Args:
        option: see `names`.
        kind: kind of the names for the message, such as ``task``.
        text: see `names`.
        known: the valid names.

    Raises:
        InputError: the list is empty, or a name does not exist.
    """
    found, allowed = names(option, text), list(known)
    for name in found:
        if name not in allowed:
            raise unknown_name(kind, name, allowed)
    return tuple(name for name in allowed if name in found)


def whole_number(text: str, least: int) -> int:
    """Parses a whole number written as 10000, 10_000 or 1e4.

    Raises:
        InputError: it is not a whole number from ``least`` to `LARGEST`.
    """
    try:
        value = Decimal(text)
    except InvalidOperation:
        value = Decimal("NaN")
    # Compared before int(), which would write out a huge exponent.
    if not (value.is_finite() and least <= value <= LARGEST and value == int(value)):
        raise InputError(
            f"must be a whole number from {least} to {LARGEST:,}, written as 10000, 10_000 or 1e4;"
            f" got {text!r}"
        )
    return int(value)


def seed_of(given: object) -> int:
    """Returns one seed.

    Raises:
        InputError: it is no whole number from 1.
    """
    try:
        return whole_number(str(given), 1)
    except InputError as error:
        raise InputError(f"a seed {error}") from error


def seeds(text: str) -> tuple[int, ...]:
    """Parses seeds; returns each once, in the order given.

    ``5`` means seeds 1 to 5, ``2,4`` seeds 2 and 4, ``7,`` seed 7 alone, ``1-3,7`` seeds 1 to 3
    and 7.

    Raises:
        InputError: the text has another form, or names no seed or more than `MOST_SEEDS`.
    """
    parts = [part.strip() for part in text.split(",") if part.strip()]
    if "," not in text and text.strip().isdecimal():
        parts = [f"1-{text.strip()}"]
    found: dict[int, None] = {}
    for part in parts or [text]:
        match = _SEEDS.fullmatch(part)
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, 0)
        if not 1 <= first <= last:
            raise InputError(
                "--seeds takes a number of seeds (5), a list of seeds (2,4 or 7,) or ranges"
                f" (1-3,7), got {text!r}"
            )
        if len(found) + last - first >= MOST_SEEDS:
            raise InputError(f"--seeds takes at most {MOST_SEEDS:,} seeds, got {text!r}")
        found |= dict.fromkeys(range(first, last + 1))
    return tuple(found)


def seeds_text(chosen: Collection[int]) -> str:
    """Returns the text that `seeds` reads as these seeds, in ascending order."""
    found = sorted(set(chosen))
    if found == list(range(1, len(found) + 1)):
        return str(len(found))
    return ",".join(map(str, found)) + ("," if len(found) == 1 else "")


def settings(given: Mapping[str, Any] | Sequence[str]) -> dict[tuple[str, str], Any]:
    """Parses settings; returns values by method and field.

    Args:
        given: values by ``METHOD.FIELD``, or texts ``METHOD.FIELD=VALUE``. A VALUE that is neither
            JSON nor a whole number like 10_000 is kept as text.

    Raises:
        InputError: a setting has another form, or is given twice.
    """
    if isinstance(given, Mapping):
        return {_place(str(place), str(place)): value for place, value in given.items()}
    found: dict[tuple[str, str], Any] = {}
    for text in given:
        name, equals, value = text.partition("=")
        place = _place(name if equals else "", text)
        if place in found:
            raise InputError(
                f"--set gives {name.strip()} twice: one value each, or several with commas"
                f" ({name.strip()}=1,2)"
            )
        found[place] = scalar(value)
    return found


def _place(place: str, text: str) -> tuple[str, str]:
    """The method and the field of ``METHOD.FIELD``; errors quote the text."""
    method, _, field = (part.strip() for part in place.partition("."))
    if not (method and field):
        raise InputError(f"--set takes METHOD.FIELD=VALUE, such as nn.epochs=50, got {text!r}")
    return method, field


def weights(given: Mapping[str, Any] | Sequence[str]) -> list[tuple[str, str, Path]]:
    """Parses files of weights; returns method, task (empty if none is named) and file of each.

    Args:
        given: files by ``METHOD`` or ``METHOD@TASK``, or texts ``METHOD=FILE``.

    Raises:
        InputError: an entry has another form.
    """
    pairs = given.items() if isinstance(given, Mapping) else [_pair(text) for text in given]
    found = []
    for place, file in pairs:
        method, _, task = (part.strip() for part in str(place).partition("@"))
        found.append((method, task, path_of("a file of --weights", file)))
    return found


def _pair(text: str) -> tuple[str, str]:
    place, _, file = text.partition("=")
    if not (place.strip() and file):
        raise InputError(f"--weights takes METHOD=FILE or METHOD@TASK=FILE, got {text!r}")
    return place, file


def scalar(text: str) -> Any:
    """Parses JSON or a whole number; returns any other text unchanged."""
    try:
        return json.loads(text)
    except ValueError:
        return int(text) if _WHOLE.fullmatch(text.strip()) else text
