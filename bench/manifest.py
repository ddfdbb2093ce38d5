"""The manifest of a results folder: the evaluations that studies have requested.

Tables show only these.
"""

import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bench.names import MANIFEST
from bench.sealed_files import DamagedError, check, read_record, reading, seal_record
from tasks.errors import InputError
from tasks.pins import MARKS

_LABEL, _KEY = re.compile("[^/\\0]+"), re.compile("[0-9a-f]{64}")


@dataclass(frozen=True)
class Name:
    """The label and key of a fit, an evaluation or a controller."""

    label: str
    key: str


@dataclass(frozen=True)
class Wanted:
    """One evaluation that a study requests."""

    fit: Name
    evaluation: Name
    """Its label is the name of its file, see `bench.names.evaluation_name`."""
    episodes: int
    controller: Name | None = None
    """The tracking controller; None if the evaluation uses none."""
    fitted: bool = True
    """Whether a method is evaluated; the expert is not fitted."""
    start: Name | None = None
    """The controller whose weights the tracking controller starts from; None if it has none."""
    pins: str = ""
    """Mark of the kernels that compute it, see `tasks.pins`; empty if the manifest does not say."""

    @property
    def place(self) -> tuple[str, str]:
        """The labels of the fit and the evaluation; a manifest has each place once."""
        return self.fit.label, self.evaluation.label

    @property
    def controllers(self) -> list[Name]:
        """The tracking controller and the one that it starts from, those that there are."""
        return [name for name in (self.controller, self.start) if name]


@dataclass(frozen=True)
class Manifest:
    """The requested evaluations of a results folder, and notes."""

    wanted: tuple[Wanted, ...] = ()
    """Sorted by place."""
    notes: tuple[str, ...] = ()
    """Notes for readers of the tables, such as about a reduced protocol."""

    def extended(self, wanted: Iterable[Wanted], note: str = "") -> "Manifest":
        """Returns the manifest with more requested evaluations.

        Of fits with the same label, the last one replaces the others and their evaluations.

        Args:
            wanted: the evaluations.
            note: note for readers of the tables; empty for none.
        """
        every = (*self.wanted, *wanted)
        last = {one.fit.label: one.fit.key for one in every}
        kept = {one.place: one for one in every if one.fit.key == last[one.fit.label]}
        notes = dict.fromkeys([*self.notes, note] if note else self.notes)
        return Manifest(tuple(kept[place] for place in sorted(kept)), tuple(notes))

    def to_bytes(self) -> bytes:
        """Returns the content of the file, which `read_manifest` reads."""
        return seal_record(asdict(self))


def read_manifest(folder: Path) -> Manifest:
    """Returns the manifest of a results folder; an empty one if there is none.

    Raises:
        InputError: the file is damaged.
    """
    path = folder / MANIFEST
    if not path.exists():
        return Manifest()
    try:
        with reading(path):
            record = read_record(path)
            wanted = tuple(_wanted(path, entry) for entry in record["wanted"])
            check(all(isinstance(note, str) for note in record["notes"]), path, "its notes")
            return Manifest(wanted, tuple(record["notes"]))
    except DamagedError as error:
        raise InputError(
            f"{error}: remove it and run the study again; stored results are kept"
        ) from error


def _wanted(path: Path, entry: dict[str, Any]) -> Wanted:
    check(type(entry["episodes"]) is int, path, "a number of episodes")
    check(type(entry["fitted"]) is bool, path, "fitted")
    fit, evaluation = (_name(path, entry[part]) for part in ("fit", "evaluation"))
    controller, start = (
        None if entry[part] is None else _name(path, entry[part])
        for part in ("controller", "start")
    )
    pins = entry.get("pins", "")
    check(pins in ("", *MARKS), path, "the mark of its kernels")
    return Wanted(fit, evaluation, entry["episodes"], controller, entry["fitted"], start, pins)


def _name(path: Path, entry: dict[str, Any]) -> Name:
    label, key = entry["label"], entry["key"]
    check(bool(_LABEL.fullmatch(label) and _KEY.fullmatch(key)), path, "a name")
    return Name(label, key)
