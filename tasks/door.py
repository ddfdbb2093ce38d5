"""Door opening: undo the latch and swing the door open."""

from collections.abc import Mapping

import numpy as np
from mujoco.batch import Batch

from tasks.adroit import AdroitTask
from tasks.components import Component, Placed, Range, xyz
from tasks.data import BoolArray, FloatArray
from tasks.masses import all_changes
from tasks.recipes import RECIPES

OPEN_ANGLE = 1.35
"""Hinge angle above which the door counts as open [rad] (appendix C)."""
AJAR_ANGLE = 1.0
"""Hinge angle above which the observation's flag says that the door is open [rad]."""
RELEASE_ANGLE = 1.2
"""Latch angle above which the bolt clears the frame [rad]. Below it, the door cannot be pulled
open."""
REACH = 0.1
"""Distance from palm to handle above which the hand does not hold it [m]. The expert pulls at about
0.03 m."""


class Door(AdroitTask):
    """Appendix B-D, "Door Opening", on the AdroitHandDoor model."""

    # Model
    name = "door"
    summary = "undo the latch and swing the door open"
    model_file = "adroit_door.xml"
    horizon = 70
    robot_dim = 28

    # Starts
    start_components = xyz("door", "m", "body_pos frame")
    in_distribution = Range((-0.3, 0.2, 0.252), (0.0, 0.35, 0.402))
    out_of_distribution = (
        Range((-0.3, 0.15, 0.252), (0.0, 0.2, 0.402)),
        Range((-0.3, 0.35, 0.252), (0.0, 0.4, 0.402)),
    )

    def place(self, batch: Batch, values: FloatArray) -> None:
        """Puts the door frame at ``values`` (B, 3) [m]."""
        batch.body("frame").pos = values

    # State
    object_components = (
        *xyz("handle", "m", "site_xpos S_handle"),
        Component("hinge_velocity", "rad/s", "qvel door_hinge"),
        *xyz("door", "m", "body_pos frame"),
    )

    def object_state(self, batch: Batch) -> FloatArray:
        """Returns handle position, hinge velocity and door position, (B, 7)."""
        handle = batch.site("S_handle").xpos
        velocity = batch.joint("door_hinge").qvel
        return np.concatenate([handle, velocity, batch.body("frame").pos], axis=1)

    # Success
    reading = Component("hinge_angle", "rad", "qpos door_hinge")
    rule = "the hinge angle is larger than 1.35 rad at the last step"

    def read(self, batch: Batch) -> FloatArray:
        """Returns the hinge angle [rad], (B,)."""
        return batch.joint("door_hinge").qpos[:, 0].copy()

    def success(self, readings: FloatArray) -> BoolArray:
        """Returns whether the door is open after the last step, (B,)."""
        return readings[:, -1] > OPEN_ANGLE

    # Failure
    watched = (
        Component("latch_angle", "rad", "qpos latch"),
        Component("palm_distance", "m", "|site_xpos S_grasp - site_xpos S_handle|"),
    )
    failure_modes = ("latch not turned", "hand lost the handle", "opened too little")

    def watch(self, batch: Batch) -> FloatArray:
        """Returns latch angle and distance from palm to handle, (B, 2)."""
        latch = batch.joint("latch").qpos
        apart = batch.site("S_grasp").xpos - batch.site("S_handle").xpos
        return np.concatenate([latch, np.linalg.norm(apart, axis=1, keepdims=True)], axis=1)

    def failed_by(self, readings: FloatArray, watched: FloatArray) -> list[BoolArray]:
        """Returns whether the latch was never turned far enough, and whether the hand let go early.

        The hand let go early if it is away from the handle at the last step and the door is not
        ajar.
        """
        latch, distance = watched[:, :, 0], watched[:, :, 1]
        turned = np.any(latch > RELEASE_ANGLE, axis=1)
        let_go = (distance[:, -1] > REACH) & (readings[:, -1] < AJAR_ANGLE)
        return [~turned, let_go]

    # Observation
    def observe(self, batch: Batch) -> FloatArray:
        """Returns the observation of AdroitHandDoor, (B, 39)."""
        hinge = batch.joint("door_hinge").qpos
        palm = batch.site("S_grasp").xpos
        handle = batch.site("S_handle").xpos
        flag = np.where(hinge > AJAR_ANGLE, 1.0, -1.0)
        hand = batch.qpos[:, 1 : self.robot_dim]
        latch = batch.joint("latch").qpos
        return np.concatenate([hand, latch, hinge, palm, handle, palm - handle, flag], axis=1)

    # Expert
    recipe = RECIPES["door"]

    # Physics
    changes = all_changes("door")

    # Minari
    placed = (Placed("door_body_pos", "body", "frame", "pos"),)

    def start_values(self, initial: Mapping[str, FloatArray]) -> FloatArray:
        """Returns the position of the door frame [m], (3,)."""
        return initial["door_body_pos"]
