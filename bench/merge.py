"""Merge results folders, as from several machines, into one."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from bench.store import Store, folder_name
from tasks.errors import InputError


def merge(folders: Sequence[Path], out: Path) -> int:
    """Copies everything sound of several results folders into one; returns how many fits there are.

    Where two hold the same evaluation, the one of more episodes is kept. What is damaged is set
    aside where it lies, in ``out`` too.

    Raises:
        InputError: a folder holds no results, or two hold different results under one label.
    """
    sources = [Store(folder) for folder in folders]
    target = Store(out)
    with target.locked():
        if target.cells.exists():
            target.sweep()
        study, notes = target.study(), target.notes()
        for source in sources:
            source.sweep()
            for label, entry in source.study().items():
                known = study.setdefault(label, {**entry, "evaluations": {}, "episodes": {}})
                _check(label, known, entry, source.folder)
                known["evaluations"] |= entry["evaluations"]
                for evaluation, count in entry["episodes"].items():
                    most = max(count, known["episodes"].get(evaluation, 0))
                    known["episodes"][evaluation] = most
            notes += [note for note in source.notes() if note not in notes]
        for source in sources:
            for label, entry in source.study().items():
                name = folder_name(label, entry["key"])
                _copy_cell(source.cells / name, target, target.cells / name)
            for folder in source.controllers.glob("*/"):
                _copy_folder(folder, target, target.controllers / folder.name)
        target.write_study(study, notes)
    return len(study)


def _check(label: str, known: dict[str, Any], entry: dict[str, Any], folder: Path) -> None:
    mine, theirs = known["evaluations"], entry["evaluations"]
    alike = all(mine.get(name, key) == key for name, key in theirs.items())
    if known["key"] != entry["key"] or not alike:
        raise InputError(
            f"{folder} holds other results of {label} than a folder before it: of another version,"
            " config, controller or set of demonstrations; merge what was run alike"
        )


def _copy_cell(source: Path, target: Store, folder: Path) -> None:
    if not source.exists():
        return
    _copy_folder(source, target, folder)
    for path in source.glob("eval-*.parquet"):
        there = folder / path.name
        if not there.exists() or _episodes(there) < _episodes(path):
            target.write(there, path.read_bytes())
    times = source / "times.json"
    if times.exists() and not (folder / times.name).exists():
        target.write(folder / times.name, times.read_bytes())


def _episodes(path: Path) -> int:
    return int(pq.read_metadata(path).num_rows)


def _copy_folder(source: Path, target: Store, folder: Path) -> None:
    if not folder.exists():
        target.write_folder(folder, {path.name: path.read_bytes() for path in source.iterdir()})
