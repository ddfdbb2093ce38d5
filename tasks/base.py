"""Task: the model, the starts, the state, success and the observation of one task.

A task file fills in these five sections, in this order. What it reads comes from a
``mujoco.batch.Batch`` through named views, so every array has the episodes B as first axis.
"""

import hashlib
import importlib.util
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from tasks.data import (
    BoolArray,
    Episodes,
    FloatArray,
    IntArray,
    Layout,
    Starts,
    generator,
)
from tasks.errors import InputError, unknown_name

IN_DISTRIBUTION = ("train", "demo", "probe", "test")
"""Splits drawn from the same ranges: to train experts, demonstrate, choose experts, test."""
SPLITS = (*IN_DISTRIBUTION, "ood")

DIVERGED = "diverged"
"""The failure mode of an episode whose simulation broke down, in every task."""

OBJECT_JOINTS = 6
"""Free objects hang on three slides and three hinges, which are the last joints of the model."""


@dataclass(frozen=True)
class Component:
    """One number of a state, a start or a reading."""

    name: str
    unit: str
    source: str
    """Where it is read from in the model."""


def xyz(name: str, unit: str, source: str) -> tuple[Component, ...]:
    """Returns the three components of a vector; ``{axis}`` in the source stands for x, y or z."""
    return tuple(Component(f"{name}_{axis}", unit, source.format(axis=axis)) for axis in "xyz")


@dataclass(frozen=True)
class Range:
    """A box from which starts are drawn uniformly."""

    low: tuple[float, ...]
    high: tuple[float, ...]

    def contains(self, values: FloatArray) -> BoolArray:
        """Returns for each row of values (B, P) whether it lies in the box, (B,)."""
        return np.all((values >= self.low) & (values <= self.high), axis=1)


class Task(ABC):
    """One task of the benchmark. Subclasses hold what differs; arrays hold what varies."""

    # Model
    name: ClassVar[str]
    summary: ClassVar[str]
    version: ClassVar[int] = 1
    """Raise it when an episode of the same actions, or its success, comes out differently."""
    model_file: ClassVar[str]
    """In the Adroit folder of gymnasium-robotics."""
    horizon: ClassVar[int]
    """T, states in an episode (appendix B)."""
    robot_dim: ClassVar[int]
    """H: x_r is the first H joint positions."""
    derived_fields: ClassVar[tuple[str, ...]] = ("xpos", "site_xpos")
    """The MjData fields beyond qpos and qvel that may be read of this task."""
    sensors: ClassVar[tuple[str, ...]] = ()
    """The sensors that the observation reads; the model's others are left out."""

    @property
    def steps(self) -> int:
        """Control steps after which an episode is judged, T - 1."""
        return self.horizon - 1

    @cached_property
    def model_path(self) -> Path:
        """Where gymnasium-robotics keeps the model, found without importing that package.

        Raises:
            InputError: the installed gymnasium-robotics has no such file.
        """
        package = importlib.util.find_spec("gymnasium_robotics")
        if package is None or package.origin is None:
            raise InputError("gymnasium-robotics is not installed: it holds the Adroit models")
        path = Path(package.origin).parent / "envs/assets/adroit_hand" / self.model_file
        if not path.is_file():
            raise InputError(f"gymnasium-robotics has no {self.model_file} at {path}")
        return path

    def specification(self) -> mujoco.MjSpec:
        """Returns a fresh, editable description of the nominal model.

        The wrist and the fingers get the gains that the Adroit environments set in their
        constructors: the XML alone has others. Sensors do not act on the physics, and most of
        them are read by nobody.
        """
        spec = mujoco.MjSpec.from_file(str(self.model_path))
        for actuator in spec.actuators:
            gain = _servo_gain(actuator.name)
            if gain is not None:
                actuator.gainprm[:3] = [gain, 0.0, 0.0]
                actuator.biasprm[:3] = [0.0, -gain, 0.0]
        for sensor in list(spec.sensors):
            if sensor.name not in self.sensors:
                spec.delete(sensor)
        return spec

    @cached_property
    def model(self) -> mujoco.MjModel:
        """The nominal model. Nobody writes to it: changes are made per simulation."""
        return self.specification().compile()

    @cached_property
    def model_hash(self) -> str:
        """SHA-256 over the names and bytes of the model's XML, mesh and texture files."""
        digest = hashlib.sha256()
        folder = self.model_path.parent
        files = mujoco.mju_getXMLDependencies(str(self.model_path))
        for path in sorted({Path(file).resolve() for file in files}):
            digest.update(f"{path.relative_to(folder.resolve())}\0".encode())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
        return digest.hexdigest()

    # Starts
    start_components: ClassVar[tuple[Component, ...]]
    in_distribution: ClassVar[Range]
    out_of_distribution: ClassVar[tuple[Range, ...]]
    """Boxes of equal volume, each drawn with equal probability (appendix D)."""

    def ranges(self, split: str) -> tuple[Range, ...]:
        """Returns the boxes of a split.

        Raises:
            InputError: there is no such split.
        """
        if split not in SPLITS:
            raise unknown_name("split", split, SPLITS)
        return (self.in_distribution,) if split in IN_DISTRIBUTION else self.out_of_distribution

    def sample(self, split: str, n: int) -> Starts:
        """Returns the first n starts of a split; start i is the same for every n > i.

        Raises:
            InputError: there is no such split, or n is negative.
        """
        boxes = self.ranges(split)
        if n < 0:
            raise InputError(f"the number of starts must be 0 or more, got {n}")
        draws = generator("starts", self.name, split).random((n, 1 + len(self.start_components)))
        low = np.array([box.low for box in boxes])
        high = np.array([box.high for box in boxes])
        box = (draws[:, 0] * len(boxes)).astype(np.int64)
        values = low[box] + draws[:, 1:] * (high - low)[box]
        return Starts(self.name, split, np.arange(n), values)

    def check_starts(self, starts: Starts) -> None:
        """Raises InputError unless the starts are this task's and lie in their split's ranges."""
        names = [component.name for component in self.start_components]
        if starts.task != self.name:
            raise InputError(f"these starts are for task {starts.task!r}, not {self.name!r}")
        if starts.values.shape[1] != len(names):
            raise InputError(
                f"a start of {self.name} has {len(names)} numbers ({', '.join(names)}),"
                f" got {starts.values.shape[1]}"
            )
        boxes = self.ranges(starts.split)
        inside = np.any([box.contains(starts.values) for box in boxes], axis=0)
        if not inside.all():
            row = np.flatnonzero(~inside)[0]
            allowed = " or ".join(_describe_range(names, box) for box in boxes)
            given = dict(zip(names, starts.values[row].tolist(), strict=True))
            raise InputError(
                f"start {starts.index[row]} of {self.name}/{starts.split} is {given}:"
                f" allowed is {allowed}"
            )

    @abstractmethod
    def place(self, batch: Batch, values: FloatArray) -> None:
        """Writes start values (B, P) into the simulations."""

    # State
    object_components: ClassVar[tuple[Component, ...]]

    @cached_property
    def layout(self) -> Layout:
        """The dimensions H, O and A."""
        return Layout(self.robot_dim, len(self.object_components), self.model.nu)

    @cached_property
    def components(self) -> tuple[Component, ...]:
        """The D numbers of the state x = [x_r, x_o], in order."""
        joints = [self.model.joint(i) for i in range(self.robot_dim)]
        slide = mujoco.mjtJoint.mjJNT_SLIDE
        robot = tuple(
            Component(joint.name, "m" if joint.type[0] == slide else "rad", f"qpos {joint.name}")
            for joint in joints
        )
        return robot + self.object_components

    def state(self, batch: Batch) -> FloatArray:
        """Returns x = [x_r, x_o], (B, D)."""
        return np.concatenate([batch.qpos[:, : self.robot_dim], self.object_state(batch)], axis=1)

    @abstractmethod
    def object_state(self, batch: Batch) -> FloatArray:
        """Returns x_o, (B, O)."""

    # Success
    reading: ClassVar[Component]
    rule: ClassVar[str]

    @abstractmethod
    def read(self, batch: Batch) -> FloatArray:
        """Returns what the success rule reads at this moment, (B,)."""

    @abstractmethod
    def success(self, readings: FloatArray) -> BoolArray:
        """Returns whether the readings (B, T-1) after each control step meet the rule, (B,)."""

    @property
    def ends_early(self) -> bool:
        """Whether success can be decided, for good, before the last step."""
        return type(self).decided is not Task.decided

    def decided(self, readings: FloatArray, left: int) -> BoolArray:
        """Returns whether success no longer depends on the readings still to come, (B,).

        Args:
            readings: (B, t) so far.
            left: how many are still to come.
        """
        return np.full(len(readings), left == 0)

    # Failure
    watched: ClassVar[tuple[Component, ...]] = ()
    """What tells how an episode failed, beside the readings."""
    failure_modes: ClassVar[tuple[str, ...]] = ("rule not met",)
    """How an episode can fail: the first that applies counts, and the last where no other does."""

    def watch(self, batch: Batch) -> FloatArray:
        """Returns the watched quantities of this moment, (B, W)."""
        return np.empty((batch.nsim, 0))

    def failed_by(self, readings: FloatArray, watched: FloatArray) -> list[BoolArray]:
        """Returns whether each failure mode but the last applies, (B,) each.

        Args:
            readings: (B, T-1) after each control step; NaN after the end of an episode.
            watched: (B, T-1, W) at the same moments, likewise.
        """
        return []

    def modes(self, episodes: Episodes, watched: FloatArray) -> NDArray[np.str_]:
        """Returns how each episode failed, (B,): `DIVERGED`, a failure mode, or "" for a success.

        Args:
            episodes: with their readings.
            watched: (B, T-1, W), see `failed_by`.
        """
        names = [DIVERGED, *self.failure_modes[:-1]]
        applies = [episodes.diverged, *self.failed_by(episodes.readings, watched)]
        failed = np.select(applies, names, self.failure_modes[-1])
        return np.where(episodes.success, "", failed)

    # Observation
    @abstractmethod
    def observe(self, batch: Batch) -> FloatArray:
        """Returns the observation of the task's gymnasium-robotics environment, one row each.

        Unlike there, kinematics are those of the present: the environment's own lag by a substep.
        """


def dropped(height: FloatArray, lifted: float, down: float) -> BoolArray:
    """Returns whether a height (B, T-1) [m] was over ``lifted`` and later below ``down``, (B,)."""
    was_lifted = np.maximum.accumulate(height > lifted, axis=1)
    return np.any(was_lifted & (height < down), axis=1)


def count_decided(count: IntArray, left: int, exceeded: int) -> BoolArray:
    """Returns whether a count (B,) exceeds a number, or cannot with as many more as are left."""
    return (count > exceeded) | (count + left <= exceeded)


def _servo_gain(actuator: str) -> float | None:
    """Gain of a wrist or finger servo as the Adroit environments set it; None for the arm."""
    if actuator.startswith("A_AR"):
        return None
    return 10.0 if actuator.startswith("A_WR") else 1.0


def _describe_range(names: Sequence[str], box: Range) -> str:
    parts = zip(names, box.low, box.high, strict=True)
    return ", ".join(f"{name} in [{low:g}, {high:g}]" for name, low, high in parts)
