"""Files of demonstrations: arrays in the safetensors format, and their SHA-256 in a second file."""

import hashlib
import os
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load

from tasks.base import Task
from tasks.data import Demos, Starts
from tasks.errors import InputError, described
from tasks.files import labels_of, to_bytes, whole_file

_ARRAYS = ("states", "velocities", "actions", "start_index", "start_values")
_TASK = "task"
"""Label of a file: the name of its task."""
_MAKING = (
    f"such a file is in the safetensors format, with the arrays {', '.join(_ARRAYS)};"
    " `bench demos record` makes one from a policy, `bench demos from-arrays` from arrays, and"
    " `bench demos import` from a Minari data set"
)


def save_demos(demos: Demos, path: Path) -> None:
    """Writes demonstrations to a file, and the file's SHA-256 to a second file beside it."""
    data = content_of(demos)
    with whole_file(path) as file, whole_file(_digest_path(path)) as digest:
        file.write_bytes(data)
        digest.write_bytes(hashlib.sha256(data).hexdigest().encode())


def content_of(demos: Demos) -> bytes:
    """Returns the content of a file of demonstrations."""
    return to_bytes(_arrays(demos), **{_TASK: demos.starts.task})


def digest_of(demos: Demos) -> str:
    """Returns the SHA-256 of the arrays, whatever the number types of the file they came from."""
    return hashlib.sha256(to_bytes(_arrays(demos))).hexdigest()


def sound_content(path: Path) -> bytes | None:
    """Returns the content of a file of demonstrations, or None if it is missing or damaged.

    Raises:
        InputError: the system does not let us read it.
    """
    digest = _digest_path(path)
    try:
        data, noted = path.read_bytes(), digest.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    return data if hashlib.sha256(data).hexdigest().encode() == noted else None


def parse_demos(task: Task, content: bytes, file: Path) -> Demos:
    """Returns the demonstrations in the content of a file.

    Raises:
        InputError: it is not such a file, belongs to another task, or has arrays that `Starts` or
            `Demos` refuse.
    """
    arrays = _check_arrays(content, file)
    shown = labels_of(content).get(_TASK, task.name)
    if shown != task.name:
        raise InputError(f"{file} holds demonstrations of {shown}, not of {task.name}")
    try:
        starts = Starts(task.name, "demo", arrays["start_index"], arrays["start_values"])
        return Demos(starts, arrays["states"], arrays["velocities"], arrays["actions"])
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    except (TypeError, AttributeError) as error:
        raise InputError(f"{file} does not hold demonstrations: {described(error)}") from error


def task_of(file: Path) -> str:
    """Returns the name of the task that a file of demonstrations shows; empty if not noted.

    Raises:
        InputError: it is not a file of demonstrations, or is damaged.
    """
    data = read_content(file)
    _check_arrays(data, file)
    return labels_of(data).get(_TASK, "")


def read_content(file: Path) -> bytes:
    """Returns the content of a file of demonstrations that a user named.

    Raises:
        InputError: it does not exist, is a folder, or was not written by `save_demos`.
    """
    if os.path.isdir(file):
        raise InputError(
            f"{file} is a folder: `bench demos import TASK {file} --out FILE` makes a file of"
            " demonstrations from a Minari data set"
        )
    data = sound_content(file)
    if data is not None:
        return data
    if not os.path.exists(file):
        raise InputError(f"{file} does not exist; {_MAKING}")
    digest = _digest_path(file)
    if digest.exists():
        raise InputError(f"{file} is damaged: its SHA-256 is not the one in {digest.name}")
    _check_arrays(file.read_bytes(), file)
    raise InputError(
        f"{file} lacks its SHA-256, which is written beside it as {digest.name}: copy both files"
    )


def _check_arrays(content: bytes, file: Path) -> dict[str, NDArray[Any]]:
    """Returns the arrays of a file; raises InputError if it does not hold demonstrations."""
    try:
        arrays = load(content)
    except SafetensorError as error:
        raise InputError(f"{file} is no file of demonstrations; {_MAKING}") from error
    missing = [name for name in _ARRAYS if name not in arrays]
    if missing:
        raise InputError(
            f"{file} does not hold demonstrations: it lacks {', '.join(missing)}; {_MAKING}"
        )
    return arrays


def _digest_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.sha256")


def _arrays(demos: Demos) -> dict[str, NDArray[Any]]:
    return {
        "states": demos.states,
        "velocities": demos.velocities,
        "actions": demos.actions,
        "start_index": demos.starts.index,
        "start_values": demos.starts.values,
    }
