"""Demonstrations from arrays: recorded actions are replayed in the simulator.

Nothing in a file is unpickled or executed.
"""

import sys
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from tasks.base import Task
from tasks.data import BoolArray, Demos, FloatArray, Starts, real
from tasks.demos_files import save_demos
from tasks.errors import InputError
from tasks.files import new_path, path_of
from tasks.recorder import record
from tasks.simulator import Simulator

REQUIRED, OPTIONAL = ("actions", "starts"), ("states",)
_AXES = {"actions": "T-1, A", "starts": "P", "states": "T, D"}
_UNREADABLE = (OSError, ValueError, EOFError, KeyError, MemoryError, zipfile.BadZipFile)


@dataclass(frozen=True)
class Replayed:
    """The outcome of replaying recorded episodes."""

    demos: Demos
    """The episodes that succeed on replay."""
    success: BoolArray
    """(N,) success of every episode, in order."""
    drift: float | None = None
    """Largest difference between the given states and the replayed ones, over successful episodes;
    None if no states were given."""

    def save(self, file: str | Path) -> None:
        """Writes the demonstrations to a new file, for `bench run --demos`.

        Raises:
            InputError: no episode succeeds, the file exists, or its folder cannot be written to.
        """
        path = new_path(path_of("file", file))
        if not len(self.demos):
            raise InputError(f"no episode succeeds on replay, so nothing is written to {path}")
        save_demos(self.demos, path)


class Replay:
    """A policy that plays back actions, one row per index of a start."""

    def __init__(self, actions: FloatArray) -> None:
        """Takes actions (N, T-1, A)."""
        self._actions = actions

    def reset(self, simulator: Simulator) -> None:
        """Selects the actions of the episodes' starts."""
        self._chosen = self._actions[simulator.starts.index]

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the recorded actions (B, A)."""
        return self._chosen[:, step]


def replay_arrays(
    task: Task, actions: ArrayLike, starts: ArrayLike, states: ArrayLike | None = None
) -> Replayed:
    """Replays recorded episodes of a task from their starts.

    The states and velocities of the returned demonstrations come from the replay.

    Args:
        task: the task.
        actions: (N, T-1, A) normalised servo set-points; they are clipped to [-1, 1].
        starts: (N, P) start values, see `bench describe TASK`.
        states: (N, T, D) recorded states. They are only compared with the replayed ones.

    Raises:
        InputError: an array is not real and finite or has another shape, or a start is out of the
            range of demonstrations.
    """
    given = {"actions": actions, "starts": starts}
    given |= {} if states is None else {"states": states}
    arrays = _checked(task, given)
    placed = Starts(task.name, "demo", np.arange(len(arrays["starts"])), arrays["starts"])
    task.check_starts(placed)
    success, demos = record(task, placed, Replay(arrays["actions"]))
    drift = None
    if "states" in arrays:
        apart = np.abs(arrays["states"][demos.starts.index] - demos.states)
        drift = float(apart.max(initial=0.0))
    return Replayed(demos, success, drift)


def read_arrays(file: Path) -> dict[str, FloatArray]:
    """Returns the arguments of `replay_arrays` from an ``.npz`` file. Names other arrays on stderr.

    Raises:
        InputError: the file does not exist, is not an ``.npz`` file, lacks an array, or holds an
            array of Python objects, which would have to be unpickled.
    """
    if file.suffix != ".npz":
        raise InputError(f"{file} must end in .npz: an archive as numpy.savez writes it is read")
    if not file.is_file():
        raise InputError(f"{file} does not exist: name an .npz file, as numpy.savez writes it")
    try:
        if not zipfile.is_zipfile(file):
            raise InputError(f"{file} is not an .npz file, as numpy.savez writes it")
        with np.load(file, allow_pickle=False) as found:
            names = list(found.files)
            missing = [name for name in REQUIRED if name not in names]
            if missing:
                raise InputError(
                    f"{file} lacks {' and '.join(missing)}: it must be an .npz file of the arrays"
                    f" {' and '.join(REQUIRED)}, and optionally {' and '.join(OPTIONAL)};"
                    f" it holds {', '.join(names) or 'no arrays by name'}"
                )
            known = (*REQUIRED, *OPTIONAL)
            left = [name for name in names if name not in known]
            if left:
                said = f"{file}: not read: {', '.join(left)}; arrays read are {', '.join(known)}"
                print(said, file=sys.stderr)
            return {name: found[name] for name in known if name in names}
    except InputError:
        raise
    except _UNREADABLE as error:
        raise InputError(f"{file} cannot be read as an .npz file of numbers: {error}") from error


def _checked(task: Task, given: Mapping[str, ArrayLike]) -> dict[str, FloatArray]:
    arrays = {name: real(f"{name} of {task.name}", values) for name, values in given.items()}
    for name, array in arrays.items():
        axes, shape = _AXES[name], task.demo_shapes[name]
        if array.ndim and not len(array):
            raise InputError(f"{name} of {task.name} holds no episodes: give one at least")
        if array.shape[1:] != shape or not array.ndim:
            sizes = ", ".join(map(str, shape))
            raise InputError(
                f"{name} of {task.name} must have shape (N, {axes}) = (N, {sizes}), got"
                f" {array.shape}"
            )
        bad = np.flatnonzero(~np.isfinite(array).all(axis=tuple(range(1, array.ndim))))
        if bad.size:
            raise InputError(
                f"{name} of {task.name} must be finite, but those of episode {bad[0]} are not"
            )
    lengths = {name: len(array) for name, array in arrays.items()}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{count} of {name}" for name, count in lengths.items())
        raise InputError(f"all arrays must have the same number of episodes, got {shown}")
    return arrays
