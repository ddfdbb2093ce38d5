"""A task on the Shadow hand of gymnasium-robotics: the index finger reaches for a point."""

from functools import cached_property
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np

from tasks.base import Task
from tasks.components import Component, Range, xyz

NEAR = 0.005
"""Distance to the target below which the finger is there [m]."""
BENT = np.array([0.0, 0.7, 0.6])
"""Angles at which the tip is in the middle of the starts: aside, knuckle, middle joint [rad]."""
FINGER = ("robot0:A_FFJ3", "robot0:A_FFJ2", "robot0:A_FFJ1")


class Shadow(Task):
    """The palm is fixed to the world, and the wrist holds still."""

    # Model
    name = "shadow"
    summary = "reach for a point with the index finger of a Shadow hand"
    model_file = "reach.xml"
    horizon = 100
    robot_dim = 24

    @cached_property
    def model_path(self):
        """The path in gymnasium-robotics, found without importing that package."""
        package = Path(find_spec("gymnasium_robotics").origin).parent
        return package / "envs/assets/hand" / self.model_file

    # Starts
    start_components = xyz("target", "m", "site_pos target0")
    in_distribution = Range((-0.043, -0.175, 0.21), (-0.023, -0.16, 0.225))
    out_of_distribution = (Range((-0.023, -0.175, 0.21), (-0.018, -0.16, 0.225)),)

    def place(self, batch, values):
        """Puts the target at ``values`` (B, 3) [m]."""
        batch.site("target0").pos = values

    # State
    object_components = (
        *xyz("tip", "m", "site_xpos robot0:S_fftip"),
        *xyz("goal", "m", "site_xpos target0"),
    )

    def object_state(self, batch):
        """Returns where fingertip and target are, (B, 6)."""
        tip, goal = batch.site("robot0:S_fftip").xpos, batch.site("target0").xpos
        return np.concatenate([tip, goal], axis=1)

    # Success
    reading = Component("distance", "m", "|site_xpos robot0:S_fftip - site_xpos target0|")
    rule = "the fingertip is closer than 0.005 m to the target at the last step"

    def read(self, batch):
        """Returns the distance from fingertip to target [m], (B,)."""
        tip, goal = batch.site("robot0:S_fftip").xpos, batch.site("target0").xpos
        return np.linalg.norm(tip - goal, axis=1)

    def success(self, readings):
        """Returns whether the fingertip is at the target after the last step, (B,)."""
        return readings[:, -1] < NEAR

    def expert(self):
        """Returns a script."""
        return Script()


class Script:
    """Bends the finger, then moves the set-points of its three servos against the error."""

    GAIN = 0.07

    def reset(self, simulator):
        """Computes how the fingertip moves with the joints, and the actions that hold still."""
        model, count = simulator.task.model, len(simulator.starts)
        low, high = model.actuator_ctrlrange.T
        self._half = (high - low) / 2
        self._still = np.tile(-(low + high) / (high - low), (count, 1))
        self._bent = np.tile(BENT, (count, 1))
        self._servos = [model.actuator(name).id for name in FINGER]
        self._inverse = np.linalg.pinv(_jacobian(model))

    def act(self, simulator, step):
        """Returns the actions (B, 20) of a control step."""
        state = simulator.state()
        error = state[:, -3:] - state[:, -6:-3]
        if step > 30:
            self._bent = self._bent + self.GAIN * error @ self._inverse.T
        actions = self._still.copy()
        share = min(1.0, (step + 1) / 20)
        actions[:, self._servos] += share * self._bent / self._half[self._servos]
        return actions


def _jacobian(model):
    """How the tip of the bent finger moves with its servos, (3, 3). Its last joints are coupled."""
    data = mujoco.MjData(model)
    joints = [model.joint(f"robot0:FFJ{number}").id for number in (3, 2, 1, 0)]
    data.qpos[joints] = [*BENT, BENT[2]]
    mujoco.mj_forward(model, data)
    whole = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, whole, None, model.site("robot0:S_fftip").id)
    side, knuckle, middle, end = whole[:, joints].T
    return np.stack([side, knuckle, middle + end], axis=1)
