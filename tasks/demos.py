"""Demonstrations: successful episodes of the expert, made once and kept in a cache."""

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load

from tasks.base import Task
from tasks.data import BoolArray, Demos, FloatArray, IntArray, Starts, UnclippedDemos, key
from tasks.errors import InputError, described
from tasks.experts import load_expert
from tasks.files import labels_of, to_bytes, whole_file, writable_folder
from tasks.masses import NOMINAL
from tasks.pins import mark, pin
from tasks.simulator import CHUNK, Policy, Simulator, rollout
from tasks.words import count_of

TRAINING = 200
VALIDATION = 50
VERSION = 1
"""Raise it when demonstrations come out differently for reasons that no other part shows."""
_BLOCK = 300
"""Starts tried at a time."""
_FOLDER = "demos"
_ARRAYS = ("states", "velocities", "actions", "start_index", "start_values")
_TASK = "task"
"""Label of a file: the task that its demonstrations show."""
_MAKING = (
    f"such a file is in the safetensors format, with the arrays {', '.join(_ARRAYS)};"
    " `bench demos record` makes one from a policy, `bench demos from-arrays` from arrays, and"
    " `bench demos import` from a Minari data set"
)
_RECORD = """
import sys
from tasks.demos import load_demos
from tasks.registry import get_task
load_demos(get_task(sys.argv[1]))
"""
"""A program that records in a process of its own, whose kernels are pinned."""
_CURE = "set BENCH_CACHE to another folder"


class Recorder:
    """A policy that acts as another does, and keeps what it saw and did."""

    def __init__(self, policy: Policy, raw: bool = False) -> None:
        self.policy, self.raw = policy, raw

    def reset(self, simulator: Simulator) -> None:
        """Begins anew."""
        self.policy.reset(simulator)
        self._simulator = simulator
        self._states: list[FloatArray] = []
        self._velocities: list[FloatArray] = []
        self._actions: list[FloatArray] = []

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the other policy's actions (B, A)."""
        actions = self.policy.act(simulator, step)
        self._see()
        self._actions.append(actions if self.raw else np.clip(actions, -1.0, 1.0))
        return actions

    def _see(self) -> None:
        self._states.append(self._simulator.state())
        robot_dim = self._simulator.task.robot_dim
        self._velocities.append(self._simulator.batch.qvel[:, :robot_dim].copy())

    def finish(self, rows: IntArray) -> Demos:
        """Returns the chosen episodes, once they have ended."""
        self._see()
        seen = (self._states, self._velocities, self._actions)
        states, velocities, actions = (np.stack(part, axis=1)[rows] for part in seen)
        kind = UnclippedDemos if self.raw else Demos
        return kind(self._simulator.starts[rows], states, velocities, actions)


def record(
    task: Task,
    starts: Starts,
    policy: Policy,
    physics: str = NOMINAL,
    threads: int = 0,
    failures: bool = False,
    raw: bool = False,
) -> tuple[BoolArray, Demos]:
    """Returns from which starts (B,) a policy succeeded, and what it did there.

    With failures, what it did in vain is recorded too, but for episodes that diverged. Actions are
    clipped to [-1, 1], as they act, or raw, as the policy gave them.
    """
    success, found = [], []
    for first in range(0, len(starts), CHUNK):
        recorder = Recorder(policy, raw)
        part = starts[first : first + CHUNK]
        episodes = rollout(task, part, recorder, physics, threads=threads, whole=True)
        success.append(episodes.success)
        kept = ~episodes.diverged if failures else episodes.success
        found.append(recorder.finish(np.flatnonzero(kept)))
    return np.concatenate(success), _join(found)


def _join(parts: list[Demos]) -> Demos:
    """Returns demonstrations of one split, one part after the other."""
    first = parts[0].starts
    index = np.concatenate([part.starts.index for part in parts])
    values = np.concatenate([part.starts.values for part in parts])
    return type(parts[0])(
        Starts(first.task, first.split, index, values),
        np.concatenate([part.states for part in parts]),
        np.concatenate([part.velocities for part in parts]),
        np.concatenate([part.actions for part in parts]),
    )


def make_demos(task: Task, expert: Policy, n: int, threads: int = 0) -> Demos:
    """Returns an expert's first n successful episodes of the split ``demo``.

    Raises:
        InputError: fewer than one episode in ten succeeds.
    """
    attempt = partial(record, task, policy=expert, threads=threads)
    return collect(task, n, "the expert", attempt)[1]


def collect(
    task: Task, n: int, who: str, attempt: Callable[[Starts], tuple[BoolArray, Demos]]
) -> tuple[BoolArray, Demos]:
    """Returns from which starts of the split ``demo`` an attempt succeeded, and n demonstrations.

    Starts are tried in blocks, from the first, until there are as many demonstrations.

    Args:
        task: what they show.
        n: how many.
        who: does it, for the message.
        attempt: returns from which starts (B,) it succeeded, and what it did there.

    Raises:
        InputError: fewer than one episode in ten succeeds.
    """
    success = np.zeros(0, np.bool_)
    found: list[Demos] = []
    while success.sum() < n:
        starts = task.sample("demo", len(success) + _BLOCK)[len(success) :]
        tried, demos = attempt(starts)
        success = np.concatenate([success, tried])
        found.append(demos)
        if 10 * success.sum() < len(success):
            raise InputError(
                f"{who} succeeded in {success.sum()} of {count_of(len(success), 'episode')} of"
                f" {task.name}, fewer than one in ten, which is too few to learn from; actions are"
                f" set-points in [-1, 1], and `bench describe {task.name}` says when an episode"
                " succeeds"
            )
    return success, _join(found)[:n]


def demos_key(task: Task) -> str:
    """Returns the key of what the task's demonstrations are made from."""
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


def load_demos(task: Task, recipe: str | None = None) -> Demos:
    """Returns demonstrations of a task from the cache.

    The expert's 250 are made anew where the cache has none whose SHA-256 is the one noted beside
    it.

    Args:
        task: what they show.
        recipe: their key, as `demos_key` or `adopt_demos` gave it; the expert's unless told.

    Raises:
        InputError: the cache has lost demonstrations that came from a file, or cannot be written
            to.
    """
    path = demos_path(task, recipe)
    data = _read(path)
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
    return _from_bytes(task, data, path)


def split(demos: Demos) -> tuple[Demos, Demos]:
    """Returns the first four fifths, to train on, and the rest, for validation."""
    training = len(demos) * TRAINING // (TRAINING + VALIDATION)
    return demos[:training], demos[training:]


def read_demos(task: Task, file: Path) -> Demos:
    """Returns the demonstrations of a file.

    Args:
        task: what they show.
        file: as `save_demos` writes it.

    Raises:
        InputError: it is no such file, is damaged, is of another task or of other dimensions, or
            holds what `Starts` or `Demos` refuse.
    """
    found = _from_bytes(task, _read_file(file), file)
    _check_for(task, found, file)
    return found


def task_of(file: Path) -> str:
    """Returns the name of the task that a file of demonstrations shows; files of old do not say.

    Raises:
        InputError: it is no such file, or is damaged.
    """
    data = _read_file(file)
    _check_arrays(data, file)
    return labels_of(data).get(_TASK, "")


def adopt_demos(task: Task, file: Path) -> str:
    """Puts demonstrations of a file into the cache; returns the key that they have there.

    Args:
        task: what they show.
        file: as `save_demos` writes it.

    Raises:
        InputError: see `read_demos`; or the cache cannot be written to.
    """
    found = read_demos(task, file)
    # Of the arrays kept, not of the file: its numbers may have been converted.
    recipe = key("demos file", hashlib.sha256(to_bytes(_arrays(found))).hexdigest())
    data = _to_bytes(found)
    path = demos_path(task, recipe)
    if _read(path) != data:
        writable_cache(_FOLDER)
        save_demos(found, path)
    return recipe


def _check_for(task: Task, demos: Demos, file: Path) -> None:
    """Raises InputError unless the demonstrations of a file can be learnt from."""
    layout = task.layout
    wanted = {
        "states": (task.horizon, layout.state_dim),
        "velocities": (task.horizon, layout.robot_dim),
        "actions": (task.steps, layout.action_dim),
    }
    for name, shape in wanted.items():
        if getattr(demos, name).shape[1:] != shape:
            raise InputError(
                f"{file}: {name} of {task.name} have shape {shape} in each demonstration, got"
                f" {getattr(demos, name).shape[1:]}"
            )
    if not all(map(len, split(demos))):
        raise InputError(
            f"{file} holds {count_of(len(demos), 'demonstration')}, too few to keep some back"
        )
    try:
        task.check_starts(demos.starts)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error


def save_demos(demos: Demos, path: Path) -> None:
    """Writes demonstrations to a file, and its SHA-256 beside it."""
    data = _to_bytes(demos)
    with whole_file(path) as file, whole_file(_digest_path(path)) as digest:
        file.write_bytes(data)
        digest.write_bytes(hashlib.sha256(data).hexdigest().encode())


def demos_path(task: Task, recipe: str | None = None) -> Path:
    """Returns where the cache keeps the demonstrations of that key, the expert's unless told."""
    name = f"{task.name}-{(recipe or demos_key(task))[:16]}.safetensors"
    return cache_folder() / _FOLDER / name


def cache_folder() -> Path:
    """Returns where what can be made again is kept: BENCH_CACHE, else in the XDG cache folder.

    Raises:
        InputError: neither is set, and the user has no home folder.
    """
    chosen = os.environ.get("BENCH_CACHE")
    if chosen:
        return Path(chosen)
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "kodex-bench"
    except RuntimeError as error:
        raise InputError(f"there is no home folder for the cache: {_CURE}") from error


def writable_cache(name: str) -> Path:
    """Returns a folder of the cache, once it is known that it can be written to or made.

    Raises:
        InputError: it cannot, or see `cache_folder`.
    """
    return writable_folder(cache_folder() / name, _CURE)


def _read(path: Path) -> bytes | None:
    """The bytes of a file of demonstrations, or None if it is missing or damaged."""
    digest = _digest_path(path)
    try:
        data, noted = path.read_bytes(), digest.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    return data if hashlib.sha256(data).hexdigest().encode() == noted else None


def _read_file(file: Path) -> bytes:
    """The bytes of a file of demonstrations that somebody names.

    Raises:
        InputError: it does not exist, is a folder, or is not what `save_demos` writes.
    """
    if os.path.isdir(file):
        raise InputError(
            f"{file} is a folder: `bench demos import TASK {file} --out FILE` makes a file of"
            " demonstrations from a Minari data set"
        )
    data = _read(file)
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


def _check_arrays(data: bytes, file: Path) -> dict[str, NDArray[Any]]:
    """Returns the arrays of a file of demonstrations; InputError if it is none."""
    try:
        arrays = load(data)
    except SafetensorError as error:
        raise InputError(f"{file} is no file of demonstrations; {_MAKING}") from error
    missing = [name for name in _ARRAYS if name not in arrays]
    if missing:
        raise InputError(
            f"{file} holds no demonstrations: it lacks {', '.join(missing)}; {_MAKING}"
        )
    return arrays


def _digest_path(path: Path) -> Path:
    return path.with_name(f"{path.name}.sha256")


def _to_bytes(demos: Demos) -> bytes:
    return to_bytes(_arrays(demos), **{_TASK: demos.starts.task})


def _arrays(demos: Demos) -> dict[str, NDArray[Any]]:
    return {
        "states": demos.states,
        "velocities": demos.velocities,
        "actions": demos.actions,
        "start_index": demos.starts.index,
        "start_values": demos.starts.values,
    }


def _from_bytes(task: Task, data: bytes, file: Path) -> Demos:
    arrays = _check_arrays(data, file)
    shown = labels_of(data).get(_TASK, task.name)
    if shown != task.name:
        raise InputError(f"{file} holds demonstrations of {shown}, not of {task.name}")
    try:
        starts = Starts(task.name, "demo", arrays["start_index"], arrays["start_values"])
        return Demos(starts, arrays["states"], arrays["velocities"], arrays["actions"])
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    except (TypeError, AttributeError) as error:
        raise InputError(f"{file} holds no demonstrations: {described(error)}") from error
