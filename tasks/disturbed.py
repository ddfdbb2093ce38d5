"""Disturbs the episodes that a policy drives, see `tasks.disturbances`."""

from collections.abc import Sequence

import mujoco
import numpy as np

from tasks.base import Task
from tasks.data import CONTROL_STEP, FloatArray, IntArray, Starts
from tasks.disturbances import Disturbance, find_disturbances
from tasks.simulator import Policy, Simulator

HAND, OBJECT = "hand", "object"


def _joints(task: Task, what: str) -> IntArray:
    """The numbers of the hand's hinges, or of the object's slides in the plane."""
    model = task.model
    if what == OBJECT:
        return np.array([model.joint(name).id for name in task.object_slides])
    return np.flatnonzero(model.jnt_type[: task.robot_dim] == mujoco.mjtJoint.mjJNT_HINGE)


def disturbed(policy: Policy, name: str, task: Task) -> Policy:
    """Returns a policy whose episodes are disturbed as the name says.

    Raises:
        InputError: see `tasks.disturbances.find_disturbances`.
    """
    found = find_disturbances(name, task)
    return Disturbed(policy, found) if found else policy


class Disturbed:
    """Wraps a policy, and disturbs the episodes that it drives."""

    def __init__(self, policy: Policy, parts: Sequence[Disturbance]) -> None:
        self.policy = policy
        self._strength = {part.kind: part.strength for part in parts}

    def reset(self, simulator: Simulator) -> None:
        """Moves hand and object, and resets the policy on what it then reads."""
        strength, task = self._strength, simulator.task
        if "joints_off" in strength:
            self._move(simulator, "joints_off", HAND)
        if "object_off" in strength:
            self._move(simulator, "object_off", OBJECT)
        simulator.refresh()
        self._pushes = [
            _Push(simulator, kind, strength[kind], _joints(task, what))
            for kind, what in (("hand_push", HAND), ("object_push", OBJECT))
            if kind in strength
        ]
        self._waiting = [simulator.set_points() for _ in range(int(strength.get("late", 0)))]
        self._noisy = _Noisy(simulator, strength["noise"]) if "noise" in strength else None
        self.policy.reset(self._noisy or simulator)

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the actions (B, A) that arrive in this step."""
        for push in self._pushes:
            push.act(simulator, step)
        self._waiting.append(self.policy.act(self._noisy or simulator, step))
        return self._waiting.pop(0)

    def _move(self, simulator: Simulator, kind: str, what: str) -> None:
        joints, model = _joints(simulator.task, what), simulator.task.model
        places = model.jnt_qposadr[joints]
        errors = [rng.standard_normal(len(joints)) for rng in _streams(simulator.starts, kind)]
        moved = simulator.batch.qpos[:, places] + self._strength[kind] * np.array(errors)
        limited = model.jnt_limited[joints].astype(bool)
        low, high = np.where(limited[:, None], model.jnt_range[joints], [-np.inf, np.inf]).T
        simulator.batch.qpos[:, places] = np.clip(moved, low, high)


class _Push:
    """Changes the velocity of some joints once, at a random step of an episode's first half."""

    def __init__(self, simulator: Simulator, kind: str, strength: float, joints: IntArray) -> None:
        streams = _streams(simulator.starts, kind)
        self._when = np.array([rng.integers(simulator.task.steps // 2) for rng in streams])
        self._kicks = strength * np.array([rng.standard_normal(len(joints)) for rng in streams])
        self._places = simulator.task.model.jnt_dofadr[joints]

    def act(self, simulator: Simulator, step: int) -> None:
        rows = np.flatnonzero(self._when == step)
        simulator.batch.qvel[np.ix_(rows, self._places)] += self._kicks[rows]


class _Noisy(Simulator):
    """The same simulator, as a policy with noisy sensors reads it."""

    def __init__(self, simulator: Simulator, strength: float) -> None:
        vars(self).update(vars(simulator))
        task = simulator.task
        widths = (task.layout.state_dim, simulator.observe().shape[1], task.layout.robot_dim)
        shape = (task.steps + 1, sum(widths))
        errors = np.array(
            [rng.standard_normal(shape) for rng in _streams(simulator.starts, "noise")]
        )
        self._errors = np.split(strength * errors, np.cumsum(widths[:-1]), axis=2)

    def state(self) -> FloatArray:
        return super().state() + self._errors[0][:, self._step()]

    def observe(self) -> FloatArray:
        return super().observe() + self._errors[1][:, self._step()]

    def joints(self) -> FloatArray:
        return self.state()[:, : self.task.robot_dim]

    def velocities(self) -> FloatArray:
        return super().velocities() + self._errors[2][:, self._step()]

    def _step(self) -> int:
        """The number of control steps taken."""
        return round(float(self.batch.time.max()) / CONTROL_STEP)


def _streams(starts: Starts, kind: str) -> list[np.random.Generator]:
    """The random stream of each episode. It does not depend on the strength."""
    return starts.streams("disturbance", kind)
