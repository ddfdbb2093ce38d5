"""Arrays that all packages share, and the letters of their axes.

===  ==========================================================
B    episodes (or starts, or demonstrations)
T    states in an episode; an episode has T - 1 control steps
H    joints of the hand and its base, the robot state x_r
O    numbers of the object state x_o
D    numbers of the state x = [x_r, x_o], so D = H + O
A    actuators
P    numbers that vary from one start to the next
===  ==========================================================

Arrays are float64 unless their description says otherwise. `real` and `whole` convert the arrays
that callers pass in.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tasks.errors import InputError, described

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

CONTROL_STEP = 0.01
"""Seconds from one state of an episode to the next, in every task."""


def key(*parts: object) -> str:
    """Returns the SHA-256 of the parts, as hexadecimal digits.

    Parts are anything that JSON can hold. The order of a dictionary's entries does not matter.
    """
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def generator(*parts: str | int) -> np.random.Generator:
    """Returns a random generator seeded by the parts.

    It depends on the parts alone, not on a global stream, the order of calls or the process. Every
    random number of the suite comes from such a generator.
    """
    return np.random.Generator(np.random.PCG64(int(key(*parts), 16)))


def real(name: str, values: ArrayLike) -> FloatArray:
    """Returns an array as C-contiguous float64.

    Args:
        name: names the array in the error message.
        values: booleans, integers or floats, of any width and byte order.

    Raises:
        InputError: the array holds other values, is masked, or is ragged.
    """
    if isinstance(values, np.ma.MaskedArray):
        raise InputError(f"{name}: a masked array of {values.dtype} is not accepted, fill it first")
    try:
        array = np.asarray(values)
    except (TypeError, ValueError, RuntimeError) as error:
        raise InputError(f"{name} cannot be read as an array: {described(error)}") from error
    if array.dtype.kind not in "buif":
        raise InputError(f"{name} must hold real numbers, got an array of {array.dtype}")
    with np.errstate(over="ignore"):  # a long double can exceed float64
        return np.asarray(array, np.float64, order="C")


def whole(name: str, values: ArrayLike) -> IntArray:
    """Returns an array of whole numbers from 0 as int64.

    Args:
        name: names the array in the error message.
        values: integers, or floats without a fraction.

    Raises:
        InputError: see `real`; or a number is negative, has a fraction, or is at least 2^53, above
            which float64 does not hold every integer.
    """
    numbers = real(name, values)
    bad = ~((numbers >= 0) & (numbers < 2**53) & (numbers == np.floor(numbers)))
    if bad.any():
        raise InputError(f"{name} must be whole numbers from 0, got {numbers[bad][0]:g}")
    return numbers.astype(np.int64)


@dataclass(frozen=True)
class Layout:
    """The dimensions of a task (appendix B). A method needs no other facts about the task."""

    robot_dim: int
    """H, number of hand joints."""
    object_dim: int
    """O, length of the object state."""
    action_dim: int
    """A, number of actuators."""

    @property
    def state_dim(self) -> int:
        """D = H + O."""
        return self.robot_dim + self.object_dim


@dataclass(frozen=True)
class Starts:
    """Start values of episodes: the numbers that vary between episodes (appendix D).

    Raises:
        InputError: the arrays differ in length or have a wrong number of axes; an index is not a
            whole number from 0; or the values are not real and finite.
    """

    task: str
    split: str
    index: IntArray
    """(B,) position of each start in its split."""
    values: FloatArray
    """(B, P) start values, in the units of the task's ``start_components``."""
    seed: int = 0
    """The seed of a study that meets them. 0: no study does, see `tasks.base.Task.sample`."""

    def __post_init__(self) -> None:
        place = f"of starts of {self.task}/{self.split}"
        index = whole(f"indices {place}", self.index)
        values = real(f"values {place}", self.values)
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
        return Starts(self.task, self.split, self.index[rows], self.values[rows], self.seed)

    def streams(self, *what: str) -> list[np.random.Generator]:
        """Returns the random stream of each episode for a purpose. Its start alone decides it."""
        place = self.task, self.split, self.seed
        return [generator(*what, *place, int(index)) for index in self.index]


@dataclass(frozen=True)
class Demos:
    """Demonstrations: recorded motions, one row per start.

    Raises:
        InputError: the shapes do not match, a number is not real and finite, or an action exceeds
            `limit`.
    """

    limit: ClassVar[float] = 1.0
    """Largest allowed absolute value of an action."""

    starts: Starts
    states: FloatArray
    """(B, T, D) x = [x_r, x_o] before each action and after the last one."""
    velocities: FloatArray
    """(B, T, H) of the hand's joints [rad/s, m/s]."""
    actions: FloatArray
    """(B, T-1, A) normalised servo set-points in [-1, 1]."""

    def __post_init__(self) -> None:
        names = ("states", "velocities", "actions")
        arrays = {name: real(f"{name} of demonstrations", getattr(self, name)) for name in names}
        shapes = {name: array.shape for name, array in arrays.items()}
        lengths = {
            (len(a), a.shape[1] + (n == "actions")) for n, a in arrays.items() if a.ndim == 3
        }
        if any(array.ndim != 3 for array in arrays.values()) or len(lengths) != 1:
            raise InputError(
                "demonstrations need states (B, T, D), velocities (B, T, H) and actions"
                f" (B, T-1, A), got shapes {shapes}"
            )
        if len(self.starts) != len(arrays["states"]):
            raise InputError(
                f"{len(arrays['states'])} demonstrations have {len(self.starts)} starts"
            )
        for name, array in arrays.items():
            _require(np.isfinite(array), name, array, "be finite")
            object.__setattr__(self, name, array)
        actions, limit = arrays["actions"], self.limit
        _require(np.abs(actions) <= limit, "actions", actions, f"lie in [-{limit:g}, {limit:g}]")

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, rows: slice | IntArray) -> Self:
        """Returns the chosen demonstrations, in the order of rows."""
        chosen = (self.states[rows], self.velocities[rows], self.actions[rows])
        return type(self)(self.starts[rows], *chosen)


class UnclippedDemos(Demos):
    """Demonstrations with the actions as a policy returned them, before clipping."""

    limit = np.inf


def _require(holds: BoolArray, name: str, array: FloatArray, must: str) -> None:
    """Raises InputError with the first demonstration for which a condition does not hold."""
    if not holds.all():
        row, *place = np.argwhere(~holds)[0]
        value = array[(row, *place)]
        raise InputError(f"{name} of demonstration {row} must {must}, got {value:g}")


@dataclass(frozen=True)
class NonFinite:
    """Answers of a method that were not finite, in one chunk of episodes."""

    row: int
    """Index of the chunk's first episode in its evaluation."""
    call: str
    """The function that gave the answers: rollout or act."""
    starts: int
    """Number of episodes with such an answer."""
    first: int
    """The earliest t of such an answer."""


@dataclass(frozen=True)
class Episodes:
    """The outcome of a rollout, one row per start."""

    starts: Starts
    success: BoolArray
    """(B,) whether the episode met the task's success rule (appendix C) and did not diverge."""
    diverged: BoolArray
    """(B,) whether the simulation became unstable."""
    steps: IntArray
    """(B,) control steps until the end or the divergence."""
    readings: FloatArray
    """(B, T-1) reading of the success rule after each control step; NaN from the divergence on."""
    non_finite: tuple[NonFinite, ...] = ()
    """The method's answers that were NaN or infinite; their episodes diverge."""


def join_demos(parts: Sequence[Demos]) -> Demos:
    """Concatenates demonstrations of one split and seed."""
    return type(parts[0])(
        _join_starts([part.starts for part in parts]),
        np.concatenate([part.states for part in parts]),
        np.concatenate([part.velocities for part in parts]),
        np.concatenate([part.actions for part in parts]),
    )


def join_episodes(parts: Sequence[Episodes]) -> Episodes:
    """Concatenates episodes of one split and seed."""
    return Episodes(
        _join_starts([part.starts for part in parts]),
        np.concatenate([part.success for part in parts]),
        np.concatenate([part.diverged for part in parts]),
        np.concatenate([part.steps for part in parts]),
        np.concatenate([part.readings for part in parts]),
        tuple(one for part in parts for one in part.non_finite),
    )


def _join_starts(parts: Sequence[Starts]) -> Starts:
    index = np.concatenate([part.index for part in parts])
    values = np.concatenate([part.values for part in parts])
    return Starts(parts[0].task, parts[0].split, index, values, parts[0].seed)
