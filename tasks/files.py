"""Arrays as bytes, and bytes on the disk."""

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load, save

from tasks.errors import InputError

_COMPLEX = "complex"
"""Metadata of a file: the names of complex arrays, stored as pairs of real numbers."""


def to_bytes(arrays: Mapping[str, NDArray[Any]], **labels: str) -> bytes:
    """Returns arrays by name as the content of a safetensors file, which `from_bytes` reads.

    The format has no complex numbers of double precision: they are stored as (..., 2).

    Args:
        arrays: what the file holds.
        labels: texts by name about the whole, which `labels_of` reads.
    """
    plain = {name: np.asarray(array, order="C") for name, array in arrays.items()}
    paired = [name for name, array in plain.items() if array.dtype.kind == "c"]
    for name in paired:
        wide = plain[name].astype(np.complex128)
        plain[name] = np.stack([wide.real, wide.imag], axis=-1)
    metadata = labels | ({_COMPLEX: json.dumps(paired)} if paired else {})
    return save(plain, metadata=metadata or None)


def from_bytes(content: bytes) -> dict[str, NDArray[Any]]:
    """Returns the arrays by name of the content of a safetensors file; they may be written to.

    Raises:
        safetensors.SafetensorError: it is no such content.
    """
    arrays = load(content)
    for name in json.loads(labels_of(content).get(_COMPLEX, "[]")):
        arrays[name] = arrays[name].view(np.complex128)[..., 0]
    return arrays


def labels_of(content: bytes) -> dict[str, str]:
    """Returns the texts by name that the content of a sound safetensors file has of the whole."""
    header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
    return dict(header.get("__metadata__", {}))


def flush(path: Path, content: bytes) -> None:
    """Writes a file, and waits until the disk has it."""
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def sync(path: Path) -> None:
    """Waits until the disk has a file, or the list of what is in a folder."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def path_of(what: str, given: str | os.PathLike[str]) -> Path:
    """Returns the path that a caller in Python names.

    Args:
        what: is named, for the message: ``"folder"``.
        given: the path; an empty text would mean the current folder.

    Raises:
        InputError: it is empty, or no path at all.
    """
    if not (isinstance(given, str | os.PathLike) and os.fspath(given)):
        raise InputError(f"{what} must be a path, such as 'results/mine', got {given!r}")
    return Path(given)


# Before the work whose results are to be written
def writable_folder(folder: Path, cure: str = "choose another place") -> Path:
    """Returns a folder that can be written to, or made. Makes nothing.

    Args:
        folder: where something is to be written.
        cure: what the user can do otherwise, for the message.

    Raises:
        InputError: a file is in the way, or the machine does not let us write there.
    """
    with _refusing(folder, cure):
        there = next(path for path in (folder.absolute(), *folder.absolute().parents) if _is(path))
        if not there.is_dir():
            raise InputError(f"{folder} cannot be written to: {there} is no folder; {cure}")
        with TemporaryFile(dir=there):
            return folder


def writable_file(path: Path) -> Path:
    """Returns the path of a file that can be written, or replaced. Makes nothing.

    Raises:
        InputError: something else is there, or its folder cannot be written to.
    """
    with _refusing(path, "choose another name"):
        place = _behind_links(path)
        there = _is(place)
        if there and not place.is_file():
            raise InputError(f"{path} is no file: choose another name")
    writable_folder(place.parent if there else place)
    return path


def new_path(path: Path) -> Path:
    """Returns a path where nothing is, and where something can be written. Makes nothing.

    Raises:
        InputError: something is there, or its folder cannot be written to.
    """
    with _refusing(path, "choose another name"):
        if _is(path):
            raise InputError(f"{path} exists already: remove it, or choose another name")
    return writable_folder(path)


@contextmanager
def _refusing(path: Path, cure: str) -> Iterator[None]:
    """Turns what the system says of a path into an InputError."""
    try:
        yield
    except InputError:
        raise
    except (OSError, ValueError) as error:  # ValueError: a null character
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{str(path)!r} cannot be written to ({reason}): {cure}") from error


def _is(path: Path) -> bool:
    """Whether something is at a path, be it a link to nothing."""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def _behind_links(path: Path) -> Path:
    return Path(os.path.realpath(path))


# The writing
@contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """Yields a path to write to, which replaces the target once all of it is on the disk.

    The path is beside the target and has its ending. If writing fails, it is removed, with the
    folders that were made for it.
    """
    target = _behind_links(target)
    with _beside(target) as temporary:
        yield temporary
        sync(temporary)
        temporary.replace(target)


@contextmanager
def whole_folder(target: Path) -> Iterator[Path]:
    """Yields a new folder to write to, which becomes the target once all of it is on the disk.

    If writing fails, it is removed, with the folders that were made for it.

    Raises:
        InputError: something is at the target, or its folder cannot be written to.
    """
    target = new_path(target).absolute()
    with _beside(target) as temporary:
        temporary.mkdir()
        yield temporary
        for path in (*temporary.rglob("*"), temporary):
            sync(path)
        temporary.rename(target)


@contextmanager
def _beside(target: Path) -> Iterator[Path]:
    """Yields a path beside a target; what is there is removed if anything is raised."""
    made = [folder for folder in target.parents if not folder.exists()]
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{uuid4().hex[:8]}-{target.name}")
    try:
        yield temporary
        sync(target.parent)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        for remove in (temporary.unlink, *(folder.rmdir for folder in made)):
            with suppress(OSError):
                remove()
        raise
