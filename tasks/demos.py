"""Demonstrations of a task: for each seed 250 successful episodes of its expert, or a file's.

They are kept in the cache. The expert's are made when they are first needed, a block for each seed.
"""

import subprocess
import sys
from pathlib import Path

import mujoco

from tasks.base import Task
from tasks.cache import cache_folder, writable_cache
from tasks.data import Demos, generator, key
from tasks.demos_files import (
    content_of,
    digest_of,
    parse_demos,
    read_content,
    save_demos,
    sound_content,
)
from tasks.errors import InputError
from tasks.experts import experts_of, load_expert
from tasks.pins import check_environment, mark, pin
from tasks.recorder import make_demos
from tasks.registry import FIRST
from tasks.words import count_of

TRAINING = 200
VALIDATION = 50
VERSION = 2
"""Raise it when demonstrations change for a reason that no other part of the key shows."""
_FOLDER = "demos"
_RECORD = """
import sys
from tasks.demos import load_demos
from tasks.registry import get_task
load_demos(get_task(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
"""
"""A program that records in a process of its own, whose kernels are pinned."""


def demos_key(task: Task, expert: str = FIRST, pins: str | None = None) -> str:
    """Returns the key of an expert's demonstrations of a task, which all seeds share.

    The key and a seed identify a block of demonstrations.

    Args:
        task: the task.
        expert: which of its experts.
        pins: mark of the kernels that record them, see `tasks.pins`. Default: this process's.
    """
    return key(
        "demos",
        VERSION,
        task.name,
        task.version,
        task.model_hash,
        load_expert(task, expert).identity,
        mujoco.__version__,
        mark() if pins is None else pins,
        TRAINING + VALIDATION,
    )


def expert_of(task: Task, chosen: str, pins: str | None = None) -> str:
    """Returns which expert's demonstrations have a key, see `demos_key`; empty if none's."""
    found = (name for name in experts_of(task) if chosen == demos_key(task, name, pins))
    return next(found, "")


def demos_path(task: Task, seed: int = 1, expert: str = FIRST) -> Path:
    """Returns the path in the cache of an expert's demonstrations for a seed."""
    name = f"{task.name}-{demos_key(task, expert)[:16]}-s{seed}.safetensors"
    return cache_folder() / _FOLDER / name


def adopted_path(task: Task, adopted: str) -> Path:
    """Returns the path in the cache of demonstrations from a file, given their key."""
    return cache_folder() / _FOLDER / f"{task.name}-{adopted[:16]}.safetensors"


def load_demos(task: Task, seed: int = 1, expert: str = FIRST) -> Demos:
    """Returns an expert's demonstrations for a seed: its successes from the starts of the seed.

    They are recorded if the cache lacks them, or if their SHA-256 is not the noted one.

    Raises:
        InputError: the cache cannot be written to; see also `tasks.pins.check_environment`.
    """
    check_environment()
    path = demos_path(task, seed, expert)
    data = sound_content(path)
    if data is None:
        writable_cache(_FOLDER)
        if path.exists():
            print(f"{path} is damaged or lacks its SHA-256: it is made anew", file=sys.stderr)
        if pin().late:
            record = [sys.executable, "-c", _RECORD, task.name, str(seed), expert]
            done = subprocess.run(record, stderr=subprocess.PIPE, text=True, check=False)
            if done.returncode:
                raise InputError((done.stderr.splitlines() or ["recording failed"])[-1])
        else:
            policy = load_expert(task, expert).policy
            save_demos(make_demos(task, policy, TRAINING + VALIDATION, seed), path)
        data = path.read_bytes()
    return parse_demos(task, data, path, seed)


def load_adopted(task: Task, adopted: str) -> Demos:
    """Returns demonstrations from a file, given their key from `adopt_demos`.

    Raises:
        InputError: the cache has lost them.
    """
    path = adopted_path(task, adopted)
    data = sound_content(path)
    if data is None:
        raise InputError(
            f"the demonstrations of {task.name} that were once in {path} are missing or"
            " damaged: give their file again with --demos"
        )
    return parse_demos(task, data, path)


def demos_of(task: Task, chosen: str, seed: int) -> tuple[Demos, Demos]:
    """Returns the demonstrations of a seed for training, and those for validation.

    Args:
        task: the task.
        chosen: key of the demonstrations, from `demos_key` or `adopt_demos`.
        seed: of the study.

    Raises:
        InputError: see `load_demos` and `load_adopted`.
    """
    if expert := expert_of(task, chosen):
        return split(load_demos(task, seed, expert))
    return split(shuffled(load_adopted(task, chosen), seed))


def split(demos: Demos) -> tuple[Demos, Demos]:
    """Splits demonstrations: the first four fifths for training, the rest for validation."""
    training = len(demos) * TRAINING // (TRAINING + VALIDATION)
    return demos[:training], demos[training:]


def shuffled(demos: Demos, seed: int) -> Demos:
    """Returns the demonstrations of a file in the order that a seed draws.

    A file holds the same demonstrations for every seed. The order decides which ones train and
    which ones validate.
    """
    return demos[generator("demos of a file", seed).permutation(len(demos))]


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
    path = adopted_path(task, adopted)
    if sound_content(path) != content_of(found):
        writable_cache(_FOLDER)
        save_demos(found, path)
    return adopted
