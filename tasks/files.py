"""Arrays as bytes, and files that are written completely or not at all."""

import json
import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load, save

from tasks.data import key
from tasks.errors import InputError

_COMPLEX = "complex"
"""Label of a file: the names of its complex arrays, which are stored as pairs of real numbers."""


LONGEST_NAME = 200
"""Largest number of characters of a `file_name`."""


def to_bytes(arrays: Mapping[str, NDArray[Any]], **labels: str) -> bytes:
    """Returns arrays by name as the content of a safetensors file. `from_bytes` reads it.

    The format lacks complex numbers of double precision, so they are stored as (..., 2).

    Args:
        arrays: the arrays by name.
        labels: texts by name about the file. `labels_of` reads them.
    """
    plain = {name: np.asarray(array, order="C") for name, array in arrays.items()}
    paired = [name for name, array in plain.items() if array.dtype.kind == "c"]
    for name in paired:
        wide = plain[name].astype(np.complex128)
        plain[name] = np.stack([wide.real, wide.imag], axis=-1)
    metadata = labels | ({_COMPLEX: json.dumps(paired)} if paired else {})
    return save(plain, metadata=metadata or None)


def from_bytes(content: bytes) -> dict[str, NDArray[Any]]:
    """Returns the arrays by name in the content of a safetensors file, as writable copies.

    Raises:
        safetensors.SafetensorError: the content is not in this format.
    """
    arrays = load(content)
    for name in json.loads(labels_of(content).get(_COMPLEX, "[]")):
        arrays[name] = arrays[name].view(np.complex128)[..., 0]
    return arrays


def labels_of(content: bytes) -> dict[str, str]:
    """Returns the labels in the content of a sound safetensors file, as texts by name."""
    header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
    return dict(header.get("__metadata__", {}))


def flush(path: Path, content: bytes) -> None:
    """Writes a file and waits until it is on the disk."""
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def sync(path: Path) -> None:
    """Waits until a file, or the list of a folder's entries, is on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def path_of(what: str, given: str | os.PathLike[str]) -> Path:
    """Returns the path that a caller in Python gives.

    Args:
        what: names the argument in the error message, such as ``"folder"``.
        given: the path. An empty text, which would mean the current folder, is refused.

    Raises:
        InputError: it is empty or not a path.
    """
    if not (isinstance(given, str | os.PathLike) and os.fspath(given)):
        raise InputError(f"{what} must be a path, such as 'results/mine', got {given!r}")
    return Path(given)


# Checks before work whose results will be written
def writable_folder(folder: Path, cure: str = "choose another place") -> Path:
    """Returns a folder after checking that it can be written to or created. Creates nothing.

    Args:
        folder: the folder.
        cure: what the user can do, for the error message.

    Raises:
        InputError: a file is in the way, or the system does not let us write there.
    """
    with _refusing(folder, cure):
        there = next(path for path in (folder.absolute(), *folder.absolute().parents) if _is(path))
        if not there.is_dir():
            raise InputError(f"{folder} cannot be written to: {there} is no folder; {cure}")
        with TemporaryFile(dir=there):
            return folder


def writable_file(path: Path) -> Path:
    """Returns a path after checking that a file can be written there. Creates nothing.

    Raises:
        InputError: something other than a file is there, or its folder cannot be written to.
    """
    with _refusing(path, "choose another name"):
        place = _behind_links(path)
        there = _is(place)
        if there and not place.is_file():
            raise InputError(f"{path} is no file: choose another name")
    writable_folder(place.parent if there else place)
    return path


def new_path(path: Path) -> Path:
    """Returns a path after checking that it is free and can be written to. Creates nothing.

    Raises:
        InputError: something is there, or its folder cannot be written to.
    """
    with _refusing(path, "choose another name"):
        if _is(path):
            raise InputError(f"{path} exists already: remove it, or choose another name")
    return writable_folder(path)


@contextmanager
def _refusing(path: Path, cure: str) -> Iterator[None]:
    """Turns errors of the file system into an InputError."""
    try:
        yield
    except InputError:
        raise
    except (OSError, ValueError) as error:  # ValueError: a null character
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{str(path)!r} cannot be written to ({reason}): {cure}") from error


def _is(path: Path) -> bool:
    """Whether something is at a path, even a broken link."""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def _behind_links(path: Path) -> Path:
    return Path(os.path.realpath(path))


# Writing
@contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """Yields a path to write to. It replaces the target once it is completely on the disk.

    The path has the folder and the suffix of the target. If the block raises, the path and the
    folders that were created for it are removed.
    """
    target = _behind_links(target)
    with _beside(target) as temporary:
        yield temporary
        sync(temporary)
        temporary.replace(target)


@contextmanager
def whole_folder(target: Path) -> Iterator[Path]:
    """Yields a new folder to write to. It becomes the target once it is completely on the disk.

    If the block raises, the folder and the folders that were created for it are removed.

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
    """Yields a path in the target's folder. If the block raises, what is there is removed."""
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


def file_name(parts: Iterable[object]) -> str:
    """Returns a name for a file: the parts, joined by hyphens, in characters of any file system.

    The end of a long name is replaced by digits of its key.
    """
    text = re.sub(r"[^\w.+=-]", "_", "-".join(map(str, parts)))
    if len(text) <= LONGEST_NAME:
        return text
    return f"{text[: LONGEST_NAME - 9]}~{key('file name', text)[:8]}"
