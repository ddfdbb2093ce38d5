"""Synthetic demonstrations, as long and as wide as a task's, on which methods are checked."""

import numpy as np

from methods.base import ActionMethod, Method, MotionMethod
from methods.contract import actions, begin, motion
from tasks.data import CONTROL_STEP, Demos, FloatArray, Layout, Starts, generator

LAYOUT = Layout(robot_dim=28, object_dim=7, action_dim=28)
"""The dimensions of Door."""
HORIZON = 100
"""T of the longest task of the suite, so that a check covers every step of a run."""

_PLACES = 0.3
"""Largest coordinate of an object [m]."""
_STIFFNESS, _DAMPING = 36.0, 12.0
"""Of joints that reach their goals within a second [1/s^2, 1/s]."""


def toy(first: int, count: int, layout: Layout = LAYOUT, horizon: int = HORIZON) -> Demos:
    """Returns demonstrations of a hand that moves to a posture that depends on an object's place.

    Args:
        first: index of the first start. The hand is always the same.
        count: N, the number of demonstrations.
        layout: the dimensions.
        horizon: T, the number of states.
    """
    place = generator("toy starts", first).uniform(-_PLACES, _PLACES, (count, layout.object_dim))
    rng = generator("toy hand")
    posture = rng.uniform(0.4, 0.8, layout.robot_dim) * rng.choice([-1.0, 1.0], layout.robot_dim)
    goal = posture + place @ rng.uniform(-0.3, 0.3, (layout.object_dim, layout.robot_dim))
    q, v = np.zeros((2, count, layout.robot_dim))
    states, velocities = [], []
    for _ in range(horizon):
        states.append(np.concatenate([q, place], axis=1))
        velocities.append(v)
        v = v + CONTROL_STEP * (_STIFFNESS * (goal - q) - _DAMPING * v)
        q = q + CONTROL_STEP * v
    x = np.stack(states, axis=1)
    # The set-points are the next joint positions.
    set_points = np.clip(x[:, 1:, : layout.action_dim], -1, 1)
    starts = Starts("toy", "demo", first + np.arange(count), place)
    return Demos(starts, x, np.stack(velocities, axis=1), set_points)


def unseen() -> Demos:
    """Returns demonstrations that no checked method has learnt from."""
    return toy(2, 6)


def answer(method: Method, demos: Demos | None = None) -> FloatArray:
    """Returns a method's motions from the starts of demonstrations, or its actions along them.

    Motions are (B, T, D or H), actions (B, T - 1, A).

    Args:
        method: a fitted method.
        demos: the demonstrations. Default: those of `unseen`.
    """
    demos = unseen() if demos is None else demos
    steps = demos.states.shape[1] - 1
    if isinstance(method, MotionMethod):
        return motion(method, demos.states[:, 0], steps)
    assert isinstance(method, ActionMethod)
    begin(method, demos.states[:, 0], streams(demos.starts))
    return np.stack([actions(method, demos.states[:, t], t) for t in range(steps)], axis=1)


def streams(starts: Starts) -> list[np.random.Generator]:
    """Returns the generator of each episode's actions. It depends on its start alone."""
    return [generator("actions", starts.task, int(index)) for index in starts.index]
