"""Object relocation: pick up the ball and carry it to the target."""

from collections.abc import Mapping

import numpy as np
from mujoco.batch import Batch

from tasks.adroit import AdroitTask
from tasks.base import OBJECT_JOINTS, count_decided, dropped
from tasks.components import Component, Placed, Range, xyz
from tasks.data import BoolArray, FloatArray, IntArray
from tasks.masses import all_changes
from tasks.recipes import RECIPES

TARGET_RADIUS = 0.1
"""Distance to the target below which the ball is at the target [m] (appendix C)."""
STEPS_AT_TARGET = 10
"""The ball must be at the target for more than this many steps (appendix C)."""
BALL_LIFTED, BALL_DOWN = 0.07, 0.04
"""Heights of the ball's centre [m]: above the first it is lifted (one radius above its resting
height, which a nudge does not reach), below the second it is back on the table. (The environment's
reward counts it as lifted above 0.04 m.)"""


class Relocation(AdroitTask):
    """Appendix B-D, "Object Relocation", on the AdroitHandRelocate model.

    The ball always starts at the centre of the table, its place in the model.
    """

    # Model
    name = "relocation"
    summary = "pick up the ball and carry it to the target"
    model_file = "adroit_relocate.xml"
    horizon = 100
    robot_dim = 30

    # Starts
    start_components = xyz("target", "m", "site_pos target")
    in_distribution = Range((-0.25, -0.25, 0.15), (0.25, 0.25, 0.35))
    out_of_distribution = (Range((-0.25, -0.25, 0.35), (0.25, 0.25, 0.40)),)

    def place(self, batch: Batch, values: FloatArray) -> None:
        """Puts the target at ``values`` (B, 3) [m]."""
        batch.site("target").pos = values

    # State
    object_components = (
        *xyz("ball_from_target", "m", "xpos Object - site_xpos target"),
        *xyz("ball_angle", "rad", "qpos OBJR{axis}"),
        *xyz("ball_velocity", "m/s", "qvel OBJT{axis}"),
        *xyz("ball_spin", "rad/s", "qvel OBJR{axis}"),
    )

    def object_state(self, batch: Batch) -> FloatArray:
        """Returns the ball's position from the target, angles and velocities, (B, 12)."""
        angles = batch.qpos[:, -OBJECT_JOINTS // 2 :]
        velocities = batch.qvel[:, -OBJECT_JOINTS:]
        return np.concatenate([self._ball_from_target(batch), angles, velocities], axis=1)

    def _ball_from_target(self, batch: Batch) -> FloatArray:
        return batch.body("Object").xpos - batch.site("target").xpos

    # Success
    reading = Component("target_distance", "m", "|xpos Object - site_xpos target|")
    rule = "the ball is closer than 0.1 m to the target after more than 10 steps"

    def read(self, batch: Batch) -> FloatArray:
        """Returns the distance from the ball to the target [m], (B,)."""
        return np.linalg.norm(self._ball_from_target(batch), axis=1)

    def success(self, readings: FloatArray) -> BoolArray:
        """Returns whether the ball was at the target for more than 10 steps, (B,)."""
        return self._steps_at_target(readings) > STEPS_AT_TARGET

    def decided(self, readings: FloatArray, left: int) -> BoolArray:
        """Returns whether the steps at the target suffice, or cannot suffice any more, (B,)."""
        return count_decided(self._steps_at_target(readings), left, STEPS_AT_TARGET)

    def _steps_at_target(self, readings: FloatArray) -> IntArray:
        return (readings < TARGET_RADIUS).sum(axis=1)

    # Failure
    watched = (Component("ball_height", "m", "xpos Object, z"),)
    failure_modes = ("not lifted", "dropped", "not brought there", "not kept there")

    def watch(self, batch: Batch) -> FloatArray:
        """Returns the height of the ball's centre, (B, 1)."""
        return batch.body("Object").xpos[:, 2:].copy()

    def failed_by(self, readings: FloatArray, watched: FloatArray) -> list[BoolArray]:
        """Returns whether the ball was never lifted, was dropped, or was never at the target.

        If none applies, the ball was at the target, but not for long enough.
        """
        height = watched[:, :, 0]
        lifted = np.any(height > BALL_LIFTED, axis=1)
        fell = dropped(height, BALL_LIFTED, BALL_DOWN)
        return [~lifted, fell, self._steps_at_target(readings) == 0]

    # Observation
    def observe(self, batch: Batch) -> FloatArray:
        """Returns the observation of AdroitHandRelocate, (B, 39)."""
        ball = batch.body("Object").xpos
        palm = batch.site("S_grasp").xpos
        target = batch.site("target").xpos
        hand = batch.qpos[:, : self.robot_dim]
        return np.concatenate([hand, palm - ball, palm - target, ball - target], axis=1)

    # Expert
    recipe = RECIPES["relocation"]

    # Physics
    changes = all_changes("relocation")

    # Minari
    placed = (
        Placed("obj_pos", "body", "Object", "pos"),
        Placed("target_pos", "site", "target", "pos"),
    )

    def start_values(self, initial: Mapping[str, FloatArray]) -> FloatArray:
        """Returns the position of the target [m], (3,)."""
        return initial["target_pos"]
