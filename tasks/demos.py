"""Demonstrations of a task: 250 successful episodes of its expert, or those of a file.

They are kept in the cache under a key. The expert's are made when they are first needed.
"""

import subprocess
import sys
from pathlib import Path

import mujoco

from tasks.base import Task
from tasks.cache import cache_folder, writable_cache
from tasks.data import Demos, key
from tasks.demos_files import (
    content_of,
    digest_of,
    parse_demos,
    read_content,
    save_demos,
    sound_content,
)
from tasks.errors import InputError
from tasks.experts import load_expert
from tasks.pins import mark, pin
from tasks.recorder import make_demos
from tasks.words import count_of

TRAINING = 200
VALIDATION = 50
VERSION = 1
"""Raise it when demonstrations change for a reason that no other part of the key shows."""
_FOLDER = "demos"
_RECORD = """
import sys
from tasks.demos import load_demos
from tasks.registry import get_task
load_demos(get_task(sys.argv[1]))
"""
"""A program that records in a process of its own, whose kernels are pinned."""


def demos_key(task: Task) -> str:
    """Returns the key of the expert's demonstrations of a task."""
    return key(
        "demos",
        VERSION,
        task.name,
        task.version,
        task.model_hash,
        load_expert(task).card["weights_sha256"],
        mujoco.__version__,
        mark(),
        TRAINING + VALIDATION,
    )


def demos_path(task: Task, cached_as: str | None = None) -> Path:
    """Returns the path of demonstrations in the cache. Default key: the expert's."""
    name = f"{task.name}-{(cached_as or demos_key(task))[:16]}.safetensors"
    return cache_folder() / _FOLDER / name


def load_demos(task: Task, cached_as: str | None = None) -> Demos:
    """Returns demonstrations of a task from the cache.

    The expert's are made if they are missing, or if their SHA-256 is not the noted one.

    Args:
        task: the task.
        cached_as: their key, from `demos_key` or `adopt_demos`. Default: the expert's.

    Raises:
        InputError: the cache has lost demonstrations that came from a file, or cannot be written
            to.
    """
    path = demos_path(task, cached_as)
    data = sound_content(path)
    if data is None:
        if path != demos_path(task):
            raise InputError(
                f"the demonstrations of {task.name} that were once in {path} are missing or"
                " damaged: give their file again with --demos"
            )
        writable_cache(_FOLDER)
        if path.exists():
            print(f"{path} is damaged or lacks its SHA-256: it is made anew", file=sys.stderr)
        if pin().late:
            subprocess.run([sys.executable, "-c", _RECORD, task.name], check=True)
        else:
            save_demos(make_demos(task, load_expert(task).policy, TRAINING + VALIDATION), path)
        data = path.read_bytes()
    return parse_demos(task, data, path)


def split(demos: Demos) -> tuple[Demos, Demos]:
    """Splits demonstrations: the first four fifths for training, the rest for validation."""
    training = len(demos) * TRAINING // (TRAINING + VALIDATION)
    return demos[:training], demos[training:]


def read_demos(task: Task, file: Path) -> Demos:
    """Returns the demonstrations of a task from a file that `save_demos` wrote.

    Raises:
        InputError: it is not such a file; is damaged; belongs to another task or has other
            dimensions; has too few demonstrations to keep some for validation; or has starts out of
            the range of demonstrations.
    """
    found = parse_demos(task, read_content(file), file)
    shapes = task.demo_shapes
    for name in ("states", "velocities", "actions"):
        shape = getattr(found, name).shape[1:]
        if shape != shapes[name]:
            raise InputError(
                f"{file}: {name} of {task.name} have shape {shapes[name]} in each demonstration,"
                f" got {shape}"
            )
    if not all(map(len, split(found))):
        raise InputError(
            f"{file} holds {count_of(len(found), 'demonstration')}, too few to keep some for"
            " validation"
        )
    try:
        task.check_starts(found.starts)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    return found


def adopt_demos(task: Task, file: Path) -> str:
    """Copies demonstrations from a file into the cache; returns their key there.

    Args:
        task: the task.
        file: a file that `save_demos` wrote.

    Raises:
        InputError: see `read_demos`; or the cache cannot be written to.
    """
    found = read_demos(task, file)
    adopted = key("demos file", digest_of(found))
    path = demos_path(task, adopted)
    if sound_content(path) != content_of(found):
        writable_cache(_FOLDER)
        save_demos(found, path)
    return adopted
