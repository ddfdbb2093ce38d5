"""Policies that drive rollouts with a fitted method.

An episode diverges, and so fails, at the first step at which the method's motion or action is not
finite.
"""

import numpy as np

from bench.controller import Controller
from methods.base import ActionMethod, MotionMethod
from methods.contract import actions, begin, motion
from tasks.data import BoolArray, FloatArray, NonFinite
from tasks.simulator import Simulator


class TrackedMotion:
    """Tracks the motion that a method predicts from the start, by a controller (appendix A)."""

    def __init__(self, method: MotionMethod, controller: Controller) -> None:
        self.method, self.controller = method, controller

    def reset(self, simulator: Simulator) -> None:
        """Predicts the motions of all episodes, over the full length of the task."""
        task = simulator.task
        planned = motion(self.method, simulator.state(), task.steps)
        self.motion = planned[:, :, : task.robot_dim]
        self._bad = _non_finite(self.motion)
        self._padding = ~simulator.running

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the controller's actions (B, A) towards the next row of the motion."""
        present = simulator.batch.qpos[:, : simulator.task.robot_dim]
        acted = self.controller.act(present, self.motion[:, step + 1])
        return _diverging(acted, self._bad[:, step + 1])

    def non_finite(self, row: int) -> tuple[NonFinite, ...]:
        """Returns which motions were not finite, for a chunk that begins at that row."""
        bad = self._bad[~self._padding]
        if not bad.any():
            return ()
        first = int(bad.any(axis=0).argmax())
        return (NonFinite(row, "rollout", int(bad.any(axis=1).sum()), first),)


class FeedbackPolicy:
    """A method that answers each state with an action."""

    def __init__(self, method: ActionMethod) -> None:
        self.method = method

    def reset(self, simulator: Simulator) -> None:
        """Passes the first states of the episodes to the method."""
        begin(self.method, simulator.state())
        self._starts, self._first = 0, 0

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the method's actions (B, A)."""
        acted = actions(self.method, simulator.state(), step)
        bad = _non_finite(acted)
        count = int((bad & simulator.running).sum())  # each is counted once: it then stops
        self._first = self._first if self._starts else step
        self._starts += count
        return _diverging(acted, bad)

    def non_finite(self, row: int) -> tuple[NonFinite, ...]:
        """Returns which actions were not finite, for a chunk that begins at that row."""
        return (NonFinite(row, "act", self._starts, self._first),) if self._starts else ()


def _non_finite(answers: FloatArray) -> BoolArray:
    """Whether an answer (..., K) has numbers that are not finite, (...)."""
    return np.asarray(~np.isfinite(answers).all(axis=-1))


def _diverging(acted: FloatArray, bad: BoolArray) -> FloatArray:
    """Actions with NaN for bad episodes, so that they diverge: infinite ones would be clipped."""
    return np.where(bad[:, None], np.nan, acted)
