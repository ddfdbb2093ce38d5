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

    def __init__(self, method: MotionMethod, controller: Controller, replan: int = 0) -> None:
        """Takes a fitted method.

        Args:
            method: predicts the motions.
            controller: tracks them.
            replan: a new motion is predicted from the present state every so many control steps.
                0: never.
        """
        self.method, self.controller, self.replan = method, controller, replan

    def reset(self, simulator: Simulator) -> None:
        """Predicts the motions of all episodes, as long as the demonstrations are.

        Of an episode that ends earlier by its rule, the first steps are kept.
        """
        task, count = simulator.task, len(simulator.starts)
        self.motion = np.empty((count, task.steps + 1, task.robot_dim))
        """(B, steps + 1, H), with what was predicted last for each moment."""
        self._first_bad = np.full(count, task.steps + 1)
        self._plan(simulator, 0)

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the controller's actions (B, A) towards the next row of the motion."""
        if self.replan and step and step % self.replan == 0:
            self._plan(simulator, step)
        acted = self.controller.act(simulator.joints(), self.motion[:, step + 1])
        return _diverging(acted, self._bad[:, step + 1])

    def non_finite(self, row: int) -> tuple[NonFinite, ...]:
        """Returns which motions were not finite, for a chunk that begins at that row."""
        bad = self._first_bad[self._first_bad < self.motion.shape[1]]
        return (NonFinite(row, "rollout", len(bad), int(bad.min())),) if len(bad) else ()

    def _plan(self, simulator: Simulator, step: int) -> None:
        task = simulator.task
        planned = motion(self.method, simulator.state(), task.horizon - 1 - step)
        self.motion[:, step:] = planned[:, : task.steps - step + 1, : task.robot_dim]
        self._bad = _non_finite(self.motion)
        hit = simulator.running & self._bad[:, step:].any(axis=1)
        first = step + self._bad[:, step:].argmax(axis=1)
        self._first_bad = np.where(hit, np.minimum(self._first_bad, first), self._first_bad)


class FeedbackPolicy:
    """A method that answers each state with an action."""

    def __init__(self, method: ActionMethod) -> None:
        self.method = method

    def reset(self, simulator: Simulator) -> None:
        """Passes the first states of the episodes to the method, and their random streams."""
        begin(self.method, simulator.state(), simulator.starts.streams("actions"))
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
