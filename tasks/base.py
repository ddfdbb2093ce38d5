"""Task: the model, starts, state and success of one task, and what else it may define.

A task's file fills in these sections, in this order; those after success are optional. It reads a
``mujoco.batch.Batch`` through named views, so the first axis of every array is the episodes, B.
"""

from __future__ import annotations

import hashlib
import inspect
import os
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from tasks.components import Component, Placed, Range
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
from tasks.masses import NOMINAL, Change

if TYPE_CHECKING:
    from tasks.recipes import Recipe
    from tasks.simulator import Policy

IN_DISTRIBUTION = ("train", "demo", "probe", "test")
"""Splits of the same ranges: to train experts, to demonstrate, to choose experts, to test."""
SPLITS = (*IN_DISTRIBUTION, "ood")

DIVERGED = "diverged"
"""Failure mode of an episode whose simulation became unstable, in every task."""

OBJECT_JOINTS = 6
"""Joints of a free object: three slides and three hinges, the last joints of the model."""


REQUIRED = (
    *("name", "summary", "model_file", "horizon", "robot_dim", "start_components"),
    *("in_distribution", "out_of_distribution", "object_components", "reading", "rule"),
)
"""Attributes that every task's class defines."""


class Task(ABC):
    """One task of the benchmark. A subclass defines it; arrays hold the values of its episodes."""

    # Model
    name: ClassVar[str]
    summary: ClassVar[str]
    version: ClassVar[int] = 1
    """Raise it when the same actions lead to other states or another success."""
    model_file: ClassVar[str]
    """Name of the XML file of the model, in the folder of the file of the class that names it."""
    horizon: ClassVar[int]
    """T, number of states in an episode (appendix B)."""
    robot_dim: ClassVar[int]
    """H: x_r is the first H joint positions."""
    derived_fields: ClassVar[tuple[str, ...]] = ("xpos", "site_xpos")
    """The MjData fields, besides qpos and qvel, that the task may read."""
    sensors: ClassVar[tuple[str, ...]] = ()
    """The sensors that the observation reads. The model's other sensors are removed."""
    object_slides: ClassVar[tuple[str, ...]] = ()
    """The joints along which the object moves freely in the horizontal plane. None if it does not,
    or if the state does not tell where it is, so that no method could answer."""

    @property
    def steps(self) -> int:
        """Number of control steps in an episode, T - 1. Success is judged after the last."""
        return self.horizon - 1

    @cached_property
    def model_path(self) -> Path:
        """Path of the model.

        Raises:
            InputError: the file does not exist.
        """
        names_it = next(kind for kind in type(self).mro() if "model_file" in vars(kind))
        path = Path(inspect.getfile(names_it)).parent / self.model_file
        if not path.is_file():
            raise InputError(f"the model of {self.name} is not there: {path} does not exist")
        return path

    def servo_gain(self, actuator: str) -> float | None:
        """Returns a gain in place of the one that an actuator has in the file; None to keep it."""
        return None

    def specification(self) -> mujoco.MjSpec:
        """Returns a new, editable description of the nominal model: the file, with servo gains.

        Unused sensors are removed, which does not change the physics.

        Raises:
            InputError: MuJoCo cannot read the file.
        """
        path = self.model_path
        with self._reading_model():
            spec = mujoco.MjSpec.from_file(str(path))
        for actuator in spec.actuators:
            gain = self.servo_gain(actuator.name)
            if gain is not None:
                actuator.gainprm[:3] = [gain, 0.0, 0.0]
                actuator.biasprm[:3] = [0.0, -gain, 0.0]
        for sensor in list(spec.sensors):
            if sensor.name not in self.sensors:
                spec.delete(sensor)
        return spec

    @cached_property
    def model(self) -> mujoco.MjModel:
        """The nominal model. It is read only: variations are written to single simulations.

        Raises:
            InputError: see `specification`, or MuJoCo cannot compile the model.
        """
        specification = self.specification()
        with self._reading_model():
            return specification.compile()

    @contextmanager
    def _reading_model(self) -> Iterator[None]:
        """Turns errors of MuJoCo into an InputError that names the file."""
        try:
            yield
        except ValueError as error:
            reason = " ".join(str(error).split())
            raise InputError(f"{self.model_path} cannot be read: {reason}") from error

    @cached_property
    def model_hash(self) -> str:
        """SHA-256 of the names and contents of the model's XML, mesh and texture files."""
        digest = hashlib.sha256()
        folder = self.model_path.parent.resolve()
        files = mujoco.mju_getXMLDependencies(str(self.model_path))
        for path in sorted({Path(file).resolve() for file in files}):
            digest.update(f"{os.path.relpath(path, folder)}\0".encode())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
        return digest.hexdigest()

    # Starts
    start_components: ClassVar[tuple[Component, ...]]
    in_distribution: ClassVar[Range]
    out_of_distribution: ClassVar[tuple[Range, ...]]
    """Boxes of equal volume. A start comes from each with equal probability (appendix D)."""

    def ranges(self, split: str) -> tuple[Range, ...]:
        """Returns the boxes from which a split's starts are drawn.

        Raises:
            InputError: there is no such split.
        """
        if split not in SPLITS:
            raise unknown_name("split", split, SPLITS)
        return (self.in_distribution,) if split in IN_DISTRIBUTION else self.out_of_distribution

    def sample(self, split: str, n: int, seed: int = 0) -> Starts:
        """Returns the first n starts of a split. Start i is the same for every n > i.

        Args:
            split: name of the split.
            n: number of starts.
            seed: of a study, from 1. Each seed has starts of its own. The starts of seed 0 belong
                to no study: experts are judged on them, and users record on them.

        Raises:
            InputError: there is no such split, or n or the seed is negative.
        """
        boxes = self.ranges(split)
        if n < 0:
            raise InputError(f"the number of starts must be 0 or more, got {n}")
        if seed < 0:
            raise InputError(f"the seed of starts must be 0 or more, got {seed}")
        stream = generator("starts", self.name, split, *([seed] if seed else []))
        draws = stream.random((n, 1 + len(self.start_components)))
        low = np.array([box.low for box in boxes])
        high = np.array([box.high for box in boxes])
        box = (draws[:, 0] * len(boxes)).astype(np.int64)
        values = low[box] + draws[:, 1:] * (high - low)[box]
        return Starts(self.name, split, np.arange(n), values, seed)

    def check_starts(self, starts: Starts) -> None:
        """Raises InputError unless the starts are of this task and in the range of their split."""
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

    @property
    def demo_shapes(self) -> dict[str, tuple[int, ...]]:
        """The shape of each array of one demonstration, by the array's name."""
        return {
            "states": (self.horizon, self.layout.state_dim),
            "velocities": (self.horizon, self.layout.robot_dim),
            "actions": (self.steps, self.layout.action_dim),
            "starts": (len(self.start_components),),
        }

    @cached_property
    def components(self) -> tuple[Component, ...]:
        """The D components of the state x = [x_r, x_o], in order."""
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
        """Returns the current reading of the success rule, (B,)."""

    @abstractmethod
    def success(self, readings: FloatArray) -> BoolArray:
        """Returns whether the readings (B, T-1) after the control steps meet the rule, (B,)."""

    @property
    def ends_early(self) -> bool:
        """Whether success can be final before the last step, see `decided`."""
        return type(self).decided is not Task.decided

    def decided(self, readings: FloatArray, left: int) -> BoolArray:
        """Returns whether success is final, whatever the remaining readings are, (B,).

        Args:
            readings: (B, t) readings so far.
            left: number of remaining readings.
        """
        return np.full(len(readings), left == 0)

    # Failure
    watched: ClassVar[tuple[Component, ...]] = ()
    """Quantities that tell how an episode failed, in addition to the readings."""
    failure_modes: ClassVar[tuple[str, ...]] = ("rule not met",)
    """Failure modes in the order of precedence; the last applies if no other does."""

    def watch(self, batch: Batch) -> FloatArray:
        """Returns the current watched quantities, (B, W)."""
        return np.empty((batch.nsim, 0))

    def failed_by(self, readings: FloatArray, watched: FloatArray) -> list[BoolArray]:
        """Returns whether each failure mode but the last applies, (B,) each.

        Args:
            readings: (B, T-1) after each control step; NaN after the end of an episode.
            watched: (B, T-1, W) at the same times, NaN likewise.
        """
        return []

    def modes(self, episodes: Episodes, watched: FloatArray) -> NDArray[np.str_]:
        """Returns the failure mode of each episode, (B,): may be `DIVERGED`; "" for a success.

        Args:
            episodes: the episodes.
            watched: (B, T-1, W), see `failed_by`.
        """
        names = [DIVERGED, *self.failure_modes[:-1]]
        applies = [episodes.diverged, *self.failed_by(episodes.readings, watched)]
        failed = np.select(applies, names, self.failure_modes[-1])
        return np.where(episodes.success, "", failed)

    # Observation
    def observe(self, batch: Batch) -> FloatArray:
        """Returns what an expert sees besides the joint velocities, a row for each episode.

        Default: the state.
        """
        return self.state(batch)

    # Expert
    recipe: ClassVar[Recipe | None] = None
    """Settings with which `bench expert train` trains an expert; None if it cannot."""

    def expert(self) -> Policy | None:
        """Returns a policy that demonstrates the task, such as a script; None if there is none.

        Raise `version` when it acts otherwise.
        """
        return None

    # Physics
    changes: ClassVar[Mapping[str, Change]] = {}
    """Variations of the physics, by name."""

    @property
    def physics(self) -> tuple[str, ...]:
        """The names of the task's physics: nominal and all variations."""
        return (NOMINAL, *self.changes)

    @property
    def variations(self) -> tuple[str, ...]:
        """The variations that the experiments compare: all of them."""
        return tuple(self.changes)

    # Methods
    default_sizes: ClassVar[Mapping[str, str]] = {}
    """By method, the size in experiments that compare no sizes. Default: the method's own choice,
    or its smallest size."""

    # Minari
    placed: ClassVar[tuple[Placed, ...]] = ()
    """What `place` writes, as Minari's data sets name it; empty if they have no such task."""

    def start_values(self, initial: Mapping[str, FloatArray]) -> FloatArray:
        """Returns the start values (P,) of an initial state, given the parts in `placed`."""
        raise NotImplementedError


def dropped(height: FloatArray, lifted: float, down: float) -> BoolArray:
    """Returns whether a height (B, T-1) [m] exceeded ``lifted``, then fell below ``down``, (B,)."""
    was_lifted = np.maximum.accumulate(height > lifted, axis=1)
    return np.any(was_lifted & (height < down), axis=1)


def count_decided(count: IntArray, left: int, exceeded: int) -> BoolArray:
    """Returns whether a count (B,) exceeds a number, or cannot reach it in the steps left, (B,)."""
    return (count > exceeded) | (count + left <= exceeded)


def _describe_range(names: Sequence[str], box: Range) -> str:
    parts = zip(names, box.low, box.high, strict=True)
    return ", ".join(f"{name} in [{low:g}, {high:g}]" for name, low, high in parts)
