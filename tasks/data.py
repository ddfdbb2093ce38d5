"""Plain arrays that every folder shares, and the letters of their axes.

===  ==========================================================
B    episodes (or starts, or demonstrations)
T    states in an episode; an episode has T - 1 control steps
H    joints of the hand and its base, the robot state x_r
O    numbers of the object state x_o
D    numbers of the state x = [x_r, x_o], so D = H + O
A    actuators
P    numbers that vary from one start to the next
===  ==========================================================

All arrays hold float64 unless their description says otherwise.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.errors import InputError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

CONTROL_STEP = 0.01
"""Seconds from one state of an episode to the next, in every task."""


def key(*parts: object) -> str:
    """Returns the SHA-256, in hexadecimal digits, of what the parts say.

    Parts are whatever JSON can hold; the order of a dictionary's entries does not matter.
    """
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def generator(*parts: str | int) -> np.random.Generator:
    """Returns the random stream that belongs to what the parts name.

    The stream depends on the parts alone: never on a global stream, the order of calls or the
    process. Every random number of the suite comes from here.
    """
    return np.random.Generator(np.random.PCG64(int(key(*parts), 16)))


@dataclass(frozen=True)
class Layout:
    """The dimensions of a task, all that a method needs to know of it (appendix B)."""

    robot_dim: int
    """H, hand joints."""
    object_dim: int
    """O, numbers of the object state."""
    action_dim: int
    """A, actuators."""

    @property
    def state_dim(self) -> int:
        """D = H + O."""
        return self.robot_dim + self.object_dim


@dataclass(frozen=True)
class Starts:
    """Where episodes begin: what varies from one to the next (appendix D).

    Raises:
        InputError: the arrays disagree in length, have a wrong number of axes, or hold a number
            that is not finite.
    """

    task: str
    split: str
    index: IntArray
    """(B,) the position of each start in its split."""
    values: FloatArray
    """(B, P) the numbers themselves, in the task's units."""

    def __post_init__(self) -> None:
        index = np.asarray(self.index, np.int64)
        values = np.asarray(self.values, np.float64)
        if index.ndim != 1 or values.ndim != 2 or len(index) != len(values):
            raise InputError(
                f"starts need an index (B,) and values (B, P) of the same length B,"
                f" got shapes {index.shape} and {values.shape}"
            )
        bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if bad.size:
            raise InputError(
                f"start {index[bad[0]]} of {self.task}/{self.split} is {values[bad[0]].tolist()}:"
                " every number must be finite"
            )
        object.__setattr__(self, "index", index)
        object.__setattr__(self, "values", values)

    def __len__(self) -> int:
        return len(self.index)

    def __getitem__(self, rows: slice | IntArray) -> "Starts":
        """Returns the chosen starts, in the order of rows."""
        return Starts(self.task, self.split, self.index[rows], self.values[rows])


@dataclass(frozen=True)
class Demos:
    """Recorded motions, one row per start.

    Raises:
        InputError: the arrays disagree in their axes, or hold a number that is not finite.
    """

    starts: Starts
    states: FloatArray
    """(B, T, D) x = [x_r, x_o] before each action, and at the end."""
    velocities: FloatArray
    """(B, T, H) of the hand's joints [rad/s, m/s]."""
    actions: FloatArray
    """(B, T-1, A) normalised servo set-points in [-1, 1]."""

    def __post_init__(self) -> None:
        arrays = {"states": self.states, "velocities": self.velocities, "actions": self.actions}
        shapes = {name: array.shape for name, array in arrays.items()}
        lengths = {
            (len(a), a.shape[1] + (n == "actions")) for n, a in arrays.items() if a.ndim == 3
        }
        if any(array.ndim != 3 for array in arrays.values()) or len(lengths) != 1:
            raise InputError(
                "demonstrations need states (B, T, D), velocities (B, T, H) and actions"
                f" (B, T-1, A), got shapes {shapes}"
            )
        if len(self.starts) != len(self.states):
            raise InputError(f"{len(self.states)} demonstrations have {len(self.starts)} starts")
        for name, array in arrays.items():
            bad = np.flatnonzero(~np.isfinite(array).all(axis=(1, 2)))
            if bad.size:
                raise InputError(f"{name} of demonstration {bad[0]} must be finite")

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, rows: slice | IntArray) -> "Demos":
        """Returns the chosen demonstrations, in the order of rows."""
        chosen = (self.states[rows], self.velocities[rows], self.actions[rows])
        return Demos(self.starts[rows], *chosen)


@dataclass(frozen=True)
class Episodes:
    """What came of a rollout, one row per start."""

    starts: Starts
    success: BoolArray
    """(B,) whether the task's rule (appendix C) was met; never where the episode diverged."""
    diverged: BoolArray
    """(B,) whether the simulation broke down."""
    steps: IntArray
    """(B,) control steps taken before the end or the divergence."""
    readings: FloatArray
    """(B, T-1) what the rule reads after each control step; NaN from the divergence on."""


def join_episodes(parts: Sequence[Episodes]) -> Episodes:
    """Returns episodes of one split, one part after the other."""
    first = parts[0].starts
    index = np.concatenate([part.starts.index for part in parts])
    values = np.concatenate([part.starts.values for part in parts])
    return Episodes(
        Starts(first.task, first.split, index, values),
        np.concatenate([part.success for part in parts]),
        np.concatenate([part.diverged for part in parts]),
        np.concatenate([part.steps for part in parts]),
        np.concatenate([part.readings for part in parts]),
    )
