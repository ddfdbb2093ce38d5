"""In-hand reorientation: turn the pen to the goal orientation."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from mujoco.batch import Batch

from tasks.adroit import AdroitTask
from tasks.base import OBJECT_JOINTS, count_decided
from tasks.components import Component, Placed, Range, xyz
from tasks.data import BoolArray, FloatArray, IntArray
from tasks.masses import all_changes
from tasks.recipes import RECIPES

PEN_LENGTH = 0.13
"""Distance between the sites at the ends of the pen, and of the goal [m]."""
SIMILARITY = 0.90
"""Cosine between pen and goal above which the pen is oriented (appendix C)."""
STEPS_ORIENTED = 10
"""The pen must be oriented for more than this many steps (appendix C)."""
PUBLISHED_SPEED = 1.0
"""Largest mean magnitude of the pen's velocities at the end, in the published code [m/s, rad/s]."""
PUBLISHED_DROP = 0.15
"""Height difference between the pen and its place above which it is dropped, there too [m]."""
UNSETTLED = 4.0
"""Subtracted from the cosine of a dropped or too fast pen, so that the reading shows both facts."""


class Reorientation(AdroitTask):
    """Appendix B-D, "In-hand Reorientation", on the AdroitHandPen model."""

    # Model
    name = "reorientation"
    summary = "turn the pen in the hand to the goal orientation"
    model_file = "adroit_pen.xml"
    horizon = 100
    robot_dim = 24
    object_slides = ("OBJTy", "OBJTz")  # their body is turned

    # Starts
    start_components = (
        Component("goal_pitch", "rad", "body_quat target, first angle"),
        Component("goal_yaw", "rad", "body_quat target, second angle"),
    )
    in_distribution = Range((-1.0, -1.0), (1.0, 1.0))
    out_of_distribution = (
        Range((-1.0, 1.0), (1.2, 1.2)),
        Range((1.0, -1.2), (1.2, 1.0)),
        Range((-1.2, -1.2), (1.0, -1.0)),
        Range((-1.2, -1.0), (-1.0, 1.2)),
    )

    def place(self, batch: Batch, values: FloatArray) -> None:
        """Turns the goal by pitch and yaw (B, 2) [rad]: about x, then about the rotated y."""
        pitch, yaw = values.T / 2
        batch.body("target").quat = np.stack(
            [
                np.cos(pitch) * np.cos(yaw),
                np.sin(pitch) * np.cos(yaw),
                np.cos(pitch) * np.sin(yaw),
                np.sin(pitch) * np.sin(yaw),
            ],
            axis=1,
        )

    # State
    object_components = (
        *xyz("pen", "m", "xpos Object"),
        *xyz("pen_direction", "1", "site_xpos object_top - object_bottom, in the goal's frame"),
        *xyz("pen_velocity", "m/s", "qvel OBJT{axis}"),
        *xyz("pen_spin", "rad/s", "qvel OBJR{axis}"),
    )

    def object_state(self, batch: Batch) -> FloatArray:
        """Returns the pen's position, its direction in the goal's frame and velocities, (B, 12)."""
        frame = goal_frame(self._goal_direction(batch))
        direction = np.einsum("bij,bj->bi", frame, self._pen_direction(batch))
        velocities = batch.qvel[:, -OBJECT_JOINTS:]
        return np.concatenate([batch.body("Object").xpos, direction, velocities], axis=1)

    def _pen_direction(self, batch: Batch) -> FloatArray:
        return _direction(batch, "object")

    def _goal_direction(self, batch: Batch) -> FloatArray:
        return _direction(batch, "target")

    # Success
    reading = Component("similarity", "1", "pen direction . goal direction")
    rule = "the cosine between pen and goal is larger than 0.90 after more than 10 steps"

    def read(self, batch: Batch) -> FloatArray:
        """Returns the cosine of the angle between pen and goal, (B,)."""
        return (self._pen_direction(batch) * self._goal_direction(batch)).sum(axis=1)

    def success(self, readings: FloatArray) -> BoolArray:
        """Returns whether the pen was oriented for more than 10 steps, (B,)."""
        return self._steps_oriented(readings) > STEPS_ORIENTED

    def decided(self, readings: FloatArray, left: int) -> BoolArray:
        """Returns whether the oriented steps suffice, or cannot suffice any more, (B,)."""
        return count_decided(self._steps_oriented(readings), left, STEPS_ORIENTED)

    def _steps_oriented(self, readings: FloatArray) -> IntArray:
        return self._oriented(readings).sum(axis=1)

    def _oriented(self, readings: FloatArray) -> BoolArray:
        return readings > SIMILARITY

    # Failure
    watched = (Component("pen_height", "m", "xpos Object - site_xpos eps_ball, z"),)
    failure_modes: ClassVar[tuple[str, ...]] = (
        "dropped",
        "not turned",
        "turned too late",
        "left again",
    )

    def watch(self, batch: Batch) -> FloatArray:
        """Returns the height of the pen above its place in the hand, (B, 1)."""
        return _height(batch)

    def failed_by(self, readings: FloatArray, watched: FloatArray) -> list[BoolArray]:
        """Returns whether the pen was dropped, was never oriented, or was oriented at the end.

        If none applies, the pen was oriented and then turned away. A held pen stays within 0.07 m
        of its place, so the published height difference tells a dropped pen.
        """
        fell = np.any(watched[:, :, 0] < -PUBLISHED_DROP, axis=1)
        oriented = self._oriented(readings)
        return [fell, ~np.any(oriented, axis=1), _last(oriented, readings)]

    # Observation
    def observe(self, batch: Batch) -> FloatArray:
        """Returns the observation of AdroitHandPen, (B, 45)."""
        position = batch.body("Object").xpos
        pen, goal = self._pen_direction(batch), self._goal_direction(batch)
        from_place = position - batch.site("eps_ball").xpos
        hand = batch.qpos[:, : self.robot_dim]
        velocities = batch.qvel[:, -OBJECT_JOINTS:]
        return np.concatenate(
            [hand, position, velocities, pen, goal, from_place, pen - goal], axis=1
        )

    # Expert
    recipe = RECIPES["reorientation"]

    # Physics
    changes = all_changes("reorientation")

    # Minari
    placed = (Placed("desired_orien", "body", "target", "quat"),)

    def start_values(self, initial: Mapping[str, FloatArray]) -> FloatArray:
        """Returns the pitch and yaw of the goal [rad], (2,)."""
        w, x, y, _ = initial["desired_orien"]
        return np.array([2 * np.arctan2(x, w), 2 * np.arctan2(y, w)])


class PublishedReorientation(Reorientation):
    """In-hand reorientation as the published code judges it: the pen must also settle."""

    rule = (
        f"{Reorientation.rule}; and at the last step, the mean magnitude of the pen's velocities is"
        " below 1 and the pen is within 0.15 m of its height"
    )

    def read(self, batch: Batch) -> FloatArray:
        """Returns the cosine, minus `UNSETTLED` if the pen is dropped or too fast, (B,)."""
        speed = np.abs(batch.qvel[:, -OBJECT_JOINTS:]).mean(axis=1)
        unsettled = (np.abs(_height(batch)[:, 0]) > PUBLISHED_DROP) | ~(speed < PUBLISHED_SPEED)
        return super().read(batch) - UNSETTLED * unsettled

    def success(self, readings: FloatArray) -> BoolArray:
        """Returns whether the pen was oriented for long enough and is settled at the end, (B,)."""
        return super().success(readings) & (readings[:, -1] > -UNSETTLED / 2)

    def decided(self, readings: FloatArray, left: int) -> BoolArray:
        """Returns whether the episode has ended, or cannot succeed any more, (B,)."""
        hopeless = self._steps_oriented(readings) + left <= STEPS_ORIENTED
        return hopeless | (left == 0)

    failure_modes = (*Reorientation.failure_modes, "not settled at the end")

    def failed_by(self, readings: FloatArray, watched: FloatArray) -> list[BoolArray]:
        """Returns the appendix's failure modes of a pen that was not oriented for long enough.

        If none applies, the pen was, but it is too fast or away from its place at the end.
        """
        fell, *others = super().failed_by(readings, watched)
        short = self._steps_oriented(readings) <= STEPS_ORIENTED
        return [fell, *(short & one for one in others), short]

    def _oriented(self, readings: FloatArray) -> BoolArray:
        settled = readings > -UNSETTLED / 2
        return super()._oriented(np.where(settled, readings, readings + UNSETTLED))


def _height(batch: Batch) -> FloatArray:
    """Height of the pen above its place in the hand [m], (B, 1)."""
    return batch.body("Object").xpos[:, 2:] - batch.site("eps_ball").xpos[:, 2:]


def _last(oriented: BoolArray, readings: FloatArray) -> BoolArray:
    """Whether the pen was oriented at the last finite reading of each episode, (B,)."""
    last = np.maximum(np.isfinite(readings).sum(axis=1) - 1, 0)
    return oriented[np.arange(len(oriented)), last]


def goal_frame(goal: FloatArray) -> FloatArray:
    """Returns rotations (B, 3, 3) that map the unit vectors ``goal`` (B, 3) to the x axis.

    The appendix (B) fixes only the x axis. The published code adds a y axis whose first two
    components are equal. It exists unless the goal is horizontal, which no start's is.
    """
    g1, g2, g3 = goal.T
    slope = -(g1 + g2) / g3
    a = 1 / np.sqrt(2 + slope**2)
    y = np.stack([a, a, a * slope], axis=1)
    return np.stack([goal, y, np.cross(goal, y)], axis=1)


def _direction(batch: Batch, body: str) -> FloatArray:
    """Unit vector from the bottom to the top of a pen, (B, 3)."""
    return (batch.site(f"{body}_top").xpos - batch.site(f"{body}_bottom").xpos) / PEN_LENGTH
