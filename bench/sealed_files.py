"""Files with a checksum that reveals damage, and writing them whole or not at all.

A record is a JSON object with its own SHA-256. A sealed folder has a record that lists the SHA-256
of the other files. A table is a parquet file with labels, and with the SHA-256 of its other bytes.
Nothing read back is executed or unpickled.
"""

import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from uuid import uuid4

import pyarrow as pa
import pyarrow.parquet as pq

from tasks.files import flush, sync

FORMAT = 2
"""To be raised when the layout of files changes; files of another format count as damaged."""
_OWN, _HASHES = "self", "sha256"
_MARK = b"sha256:"
_UNSEALED = _MARK + b"0" * 64


class DamagedError(Exception):
    """A file differs from what was written."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(f"{path} is damaged ({reason})")
        self.path, self.reason = path, reason


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turns errors that a damaged file causes into a DamagedError."""
    try:
        yield
    except (OSError, ValueError, KeyError, TypeError, AttributeError, pa.ArrowException) as error:
        raise DamagedError(path, f"{path.name} cannot be read ({error})") from error


def check(passes: bool, path: Path, what: str) -> None:
    """Raises DamagedError unless a check of a part of a file passes."""
    if not passes:
        raise DamagedError(path, f"{what} is not what was written")


# Records
def seal_record(record: Mapping[str, Any]) -> bytes:
    """Returns the content of a JSON file that `read_record` reads."""
    # Types of JSON, so that the hash is of what will be read.
    plain = json.loads(json.dumps({"format": FORMAT} | dict(record)))
    return json.dumps(plain | {_OWN: _record_digest(plain)}, indent=1).encode()


def read_record(path: Path) -> dict[str, Any]:
    """Returns a record.

    Raises:
        DamagedError: the file cannot be read, or is not what was written.
    """
    with reading(path):
        record = dict(json.loads(path.read_bytes()))
        check(record.pop(_OWN) == _record_digest(record), path, path.name)
        check(record.pop("format") == FORMAT, path, "its format")
    return record


def _record_digest(record: Mapping[str, Any]) -> str:
    return _sha256(json.dumps(record, sort_keys=True).encode())


# Folders
def seal_folder(
    name: str, record: Mapping[str, Any], contents: Mapping[str, bytes]
) -> dict[str, bytes]:
    """Returns the files of a sealed folder by name, to be written with `write_folder`.

    Args:
        name: of the file of the record.
        record: the record of the folder.
        contents: the other files by name.
    """
    hashes = {file: _sha256(content) for file, content in contents.items()}
    return {**contents, name: seal_record({**record, _HASHES: hashes})}


def read_folder(folder: Path, name: str) -> dict[str, Any]:
    """Returns the record of a sealed folder once all files that it lists have been checked.

    Raises:
        DamagedError: a file cannot be read, or is not what was written.
    """
    record = read_record(folder / name)
    with reading(folder / name):
        for file in record[_HASHES]:
            read_content(folder, record, file)
    return record


def read_content(folder: Path, record: Mapping[str, Any], file: str) -> bytes:
    """Returns the content of a file that the record of a sealed folder lists.

    Raises:
        DamagedError: it cannot be read, or is not what was written.
    """
    path = folder / Path(file).name
    with reading(path):
        content = path.read_bytes()
        check(_sha256(content) == record[_HASHES][file], path, file)
    return content


def content_names(record: Mapping[str, Any]) -> list[str]:
    """Returns the names of the files that the record of a sealed folder lists."""
    return list(record[_HASHES])


# Tables
def seal_table(table: pa.Table, labels: Mapping[str, str]) -> bytes:
    """Returns the content of a parquet file that `read_table` reads."""
    marked = {**labels, "format": str(FORMAT), "seal": _UNSEALED}
    sink = pa.BufferOutputStream()
    pq.write_table(table.replace_schema_metadata(marked), sink, compression="zstd")
    content = sink.getvalue().to_pybytes()
    place = content.rindex(_UNSEALED)
    return content[:place] + _seal(content, place) + content[place + len(_UNSEALED) :]


def read_table(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """Returns a table, or some of its columns, once its content has been checked.

    Raises:
        DamagedError: the file cannot be read, or is not what was written.
    """
    with reading(path):
        chosen = None if columns is None else list(columns)
        return pq.read_table(pa.BufferReader(_sealed_content(path)), columns=chosen)


def read_labels(path: Path) -> tuple[dict[str, str], int]:
    """Returns the labels and the number of rows of a table, checked; no column is decoded.

    Raises:
        DamagedError: the file cannot be read, or is not what was written.
    """
    with reading(path):
        found = pq.read_metadata(pa.BufferReader(_sealed_content(path)))
        labels = {name.decode(): value.decode() for name, value in found.metadata.items()}
        check(labels["format"] == str(FORMAT), path, "its format")
        return labels, int(found.num_rows)


def _sealed_content(path: Path) -> bytes:
    content = path.read_bytes()
    place = content.rfind(_MARK)
    sound = place >= 0 and content[place : place + len(_UNSEALED)] == _seal(content, place)
    check(sound, path, "its content")
    return content


def _seal(content: bytes, place: int) -> bytes:
    """The mark and SHA-256 of a content that has, or will have, them at a place."""
    view = memoryview(content)
    digest = hashlib.sha256(view[:place])
    digest.update(_UNSEALED)
    digest.update(view[place + len(_UNSEALED) :])
    return _MARK + digest.hexdigest().encode()


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


# Writing
def write_file(path: Path, content: bytes, unfinished: Path) -> None:
    """Writes a file whole or not at all, and waits until it is on the disk.

    Args:
        path: of the file, which is replaced.
        content: its new content.
        unfinished: a folder on the same disk for incomplete files, created if needed.
    """
    temporary = unfinished / uuid4().hex
    temporary.parent.mkdir(exist_ok=True)
    flush(temporary, content)
    temporary.replace(path)
    sync(path.parent)


def write_folder(folder: Path, files: Mapping[str, bytes], unfinished: Path) -> None:
    """Writes a new folder of files, given by name, whole or not at all; see `write_file`."""
    temporary = unfinished / folder.name
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    for name, content in files.items():
        flush(temporary / name, content)
    folder.parent.mkdir(exist_ok=True)
    temporary.rename(folder)
    sync(folder.parent)
