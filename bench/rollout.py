"""Policies that drive rollouts with a fitted method.

An episode diverges, and so fails, at the first step at which the method's motion or action is not
finite.
"""

import numpy as np

from bench.controller import Controller
from methods.base import ActionMethod, MotionMethod
from methods.contract import actions, begin, motion
from tasks.data import FloatArray, NonFinite
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
        self._answers = _Answers("rollout")

    def reset(self, simulator: Simulator) -> None:
        """Predicts the motions of all episodes, as long as the demonstrations are.

        Of an episode that ends earlier by its rule, the first steps are kept.
        """
        task, count = simulator.task, len(simulator.starts)
        self.motion = np.empty((count, task.steps + 1, task.robot_dim))
        """(B, steps + 1, H), with what was predicted last for each moment."""
        self._answers = _Answers("rollout")
        self._plan(simulator, 0)

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the controller's actions (B, A) towards the next row of the motion."""
        if self.replan and step and step % self.replan == 0:
            self._plan(simulator, step)
        following = self.motion[:, step + 1]
        acted = self.controller.act(simulator.joints(), following)
        return self._answers.checked(acted, following, simulator, step + 1)

    def non_finite(self, row: int) -> tuple[NonFinite, ...]:
        """Returns which motions were not finite, for a chunk that begins at that row."""
        return self._answers.non_finite(row)

    def _plan(self, simulator: Simulator, step: int) -> None:
        task = simulator.task
        planned = motion(self.method, simulator.state(), task.horizon - 1 - step)
        self.motion[:, step:] = planned[:, : task.steps - step + 1, : task.robot_dim]


class FeedbackPolicy:
    """A method that answers each state with an action."""

    def __init__(self, method: ActionMethod) -> None:
        self.method = method
        self._answers = _Answers("act")

    def reset(self, simulator: Simulator) -> None:
        """Passes the first states of the episodes to the method, and their random streams."""
        begin(self.method, simulator.state(), simulator.starts.streams("actions"))
        self._answers = _Answers("act")

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the method's actions (B, A)."""
        acted = actions(self.method, simulator.state(), step)
        return self._answers.checked(acted, acted, simulator, step)

    def non_finite(self, row: int) -> tuple[NonFinite, ...]:
        """Returns which actions were not finite, for a chunk that begins at that row."""
        return self._answers.non_finite(row)


class _Answers:
    """Counts the episodes that diverge because an answer of the method is not finite."""

    def __init__(self, call: str) -> None:
        self._call, self._first = call, 0
        self._episodes = np.zeros(1, bool)
        """(B,) whether an episode has had such an answer."""

    def checked(
        self, acted: FloatArray, answers: FloatArray, simulator: Simulator, t: int
    ) -> FloatArray:
        """Returns the actions (B, A), with NaN where the answers (B, K) after t steps are bad.

        So these episodes diverge: infinite actions would be clipped.
        """
        bad = np.asarray(~np.isfinite(answers).all(axis=1))
        if not self._episodes.any():
            self._first = t
        self._episodes = self._episodes | (bad & simulator.running)
        return np.where(bad[:, None], np.nan, acted)

    def non_finite(self, row: int) -> tuple[NonFinite, ...]:
        """Returns what was counted, for a chunk that begins at that row."""
        count = int(self._episodes.sum())
        return (NonFinite(row, self._call, count, self._first),) if count else ()
