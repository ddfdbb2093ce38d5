"""Tool use: pick up the hammer and drive the nail into the board."""

from collections.abc import Mapping

import numpy as np
from mujoco.batch import Batch

from tasks.adroit import AdroitTask
from tasks.base import OBJECT_JOINTS, dropped
from tasks.components import Component, Placed, Range, xyz
from tasks.data import BoolArray, FloatArray, IntArray
from tasks.masses import all_changes
from tasks.recipes import RECIPES

NAIL_DISTANCE = 0.01
"""Distance from nail to goal below which the nail is driven in [m] (appendix C)."""
NAIL_MOVED = 0.001
"""A nail that came this much closer to its goal was hit [m]; an untouched nail stays put."""
HAMMER_LIFTED, HAMMER_DOWN = 0.07, 0.04
"""Heights of the hammer's centre [m]: above the first it is clear of the table, below the second it
is back on it. (The environment's reward counts it as lifted above 0.04 m.)"""
PUBLISHED_STEPS = 30
"""Number of control steps after which the published code judges success."""
CONTACT_MARGIN = 0.01
"""Margin between bounding spheres below which a body may touch the nail [m]."""


class Tool(AdroitTask):
    """Appendix B-D, "Tool Use", on the AdroitHandHammer model."""

    # Model
    name = "tool"
    summary = "pick up the hammer and drive the nail into the board"
    model_file = "adroit_hammer.xml"
    horizon = 100
    robot_dim = 26
    derived_fields = (*AdroitTask.derived_fields, "xmat", "geom_xpos", "sensordata")
    sensors = ("S_nail",)
    object_slides = ("OBJTx", "OBJTz")  # their body is turned

    # Starts
    start_components = (Component("nail_height", "m", "body_pos nail_board, z"),)
    in_distribution = Range((0.1,), (0.25,))
    out_of_distribution = (Range((0.05,), (0.1,)), Range((0.25,), (0.3,)))

    def place(self, batch: Batch, values: FloatArray) -> None:
        """Puts the board at the heights ``values`` (B, 1) [m]."""
        batch.expand("body_pos")[:, batch.model.body("nail_board").id, 2:] = values

    # State
    object_components = (
        *xyz("hammer_head", "m", "site_xpos tool"),
        *xyz("hammer_angle", "rad", "xmat Object, as Euler angles"),
        *xyz("hammer_velocity", "m/s", "qvel OBJT{axis}, clipped to [-1, 1]"),
        *xyz("hammer_spin", "rad/s", "qvel OBJR{axis}, clipped to [-1, 1]"),
        *xyz("nail_goal", "m", "site_xpos nail_goal"),
    )

    def object_state(self, batch: Batch) -> FloatArray:
        """Returns the hammer's head, orientation and velocities and the nail's goal, (B, 15)."""
        head = batch.site("tool").xpos
        goal = batch.site("nail_goal").xpos
        return np.concatenate([head, _euler(batch), _velocities(batch), goal], axis=1)

    # Success
    reading = Component("nail_distance", "m", "|site_xpos S_target - site_xpos nail_goal|")
    rule = "the nail is closer than 0.01 m to its goal at the last step"

    def read(self, batch: Batch) -> FloatArray:
        """Returns the distance from the nail to its goal [m], (B,)."""
        nail, goal = batch.site("S_target").xpos, batch.site("nail_goal").xpos
        return np.linalg.norm(nail - goal, axis=1)

    def success(self, readings: FloatArray) -> BoolArray:
        """Returns whether the nail is at its goal after the last step, (B,)."""
        return readings[:, -1] < NAIL_DISTANCE

    # Failure
    watched = (Component("hammer_height", "m", "xpos Object, z"),)
    failure_modes = ("hammer dropped", "nail not reached", "not driven far enough")

    def watch(self, batch: Batch) -> FloatArray:
        """Returns the height of the hammer's centre, (B, 1)."""
        return batch.body("Object").xpos[:, 2:].copy()

    def failed_by(self, readings: FloatArray, watched: FloatArray) -> list[BoolArray]:
        """Returns whether the hammer was dropped, and whether the nail was never hit."""
        fell = dropped(watched[:, :, 0], HAMMER_LIFTED, HAMMER_DOWN)
        hit = np.any(readings[:, :1] - readings > NAIL_MOVED, axis=1)
        return [fell, ~hit]

    # Observation
    def observe(self, batch: Batch) -> FloatArray:
        """Returns the observation of AdroitHandHammer, (B, 46)."""
        hand_and_nail = batch.qpos[:, :-OBJECT_JOINTS]
        palm = batch.site("S_grasp").xpos
        nail = batch.site("S_target").xpos
        hammer = batch.body("Object").xpos
        velocities, angles = _velocities(batch), _euler(batch)
        impact = np.clip(_nail_impact(batch), -1.0, 1.0)
        return np.concatenate(
            [hand_and_nail, velocities, palm, hammer, angles, nail, impact], axis=1
        )

    # Expert
    recipe = RECIPES["tool"]

    # Physics
    changes = all_changes("tool")

    # Minari
    placed = (Placed("board_pos", "body", "nail_board", "pos"),)

    def start_values(self, initial: Mapping[str, FloatArray]) -> FloatArray:
        """Returns the height of the board [m], (1,)."""
        return initial["board_pos"][2:]


class PublishedTool(Tool):
    """Tool use as the published code judges it: success is read at the 31st state."""

    rule = "the nail is closer than 0.01 m to its goal after 30 steps"

    @property
    def steps(self) -> int:
        """Number of control steps in an episode. Success is judged after the last."""
        return PUBLISHED_STEPS


def _velocities(batch: Batch) -> FloatArray:
    """Hammer velocities [m/s, rad/s], (B, 6), clipped like the environment's observation."""
    return np.clip(batch.qvel[:, -OBJECT_JOINTS:], -1.0, 1.0)


def _euler(batch: Batch) -> FloatArray:
    """Intrinsic Euler angles (B, 3) [rad], in the order x, y, z."""
    r = batch.body("Object").xmat.reshape(-1, 3, 3)
    x = np.arctan2(-r[:, 1, 2], r[:, 2, 2])
    y = np.arctan2(r[:, 0, 2], np.hypot(r[:, 2, 2], r[:, 1, 2]))
    z = np.arctan2(-r[:, 0, 1], r[:, 0, 0])
    return np.stack([x, y, z], axis=1)


def _nail_impact(batch: Batch) -> FloatArray:
    """Touch sensor of the nail, (B, 1) [N].

    A force needs the full dynamics. They are computed only where a body may touch the nail;
    elsewhere the sensor reads zero.
    """
    near = _near_nail(batch)
    batch.forward(near)
    impact = np.zeros((batch.nsim, 1))
    impact[near] = batch.sensor("S_nail").data[near]
    return impact


def _near_nail(batch: Batch) -> IntArray:
    """Simulations in which the bounding spheres of a moving body and the nail nearly meet.

    Fixed bodies do not count: the nail slides parallel to the table, well above it.
    """
    model = batch.model
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    moves = model.body_weldid[model.geom_bodyid] != 0
    nail = model.geom_bodyid == model.body("nail").id
    others = collides & moves & ~nail
    gaps = batch.geom_xpos[:, nail, None] - batch.geom_xpos[:, None, others]
    reach = model.geom_rbound[nail][:, None] + model.geom_rbound[others] + CONTACT_MARGIN
    return np.flatnonzero(((gaps**2).sum(axis=-1) < reach**2).any(axis=(1, 2)))
