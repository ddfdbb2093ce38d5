"""One policy, one task, one list of starts: what drives a rollout.

Whatever a method predicts or does, an episode in which its answer is not finite diverges at that
step, and so fails. It is the same rule for motions and for actions.
"""

import numpy as np

from bench.controller import Controller
from methods.base import ActionMethod, MotionMethod
from methods.contract import actions, begin, motion
from tasks.data import BoolArray, FloatArray, NonFinite
from tasks.simulator import Simulator


class TrackedMotion:
    """A motion that a method predicts from the start, tracked by the controller (appendix A)."""

    def __init__(self, method: MotionMethod, controller: Controller) -> None:
        self.method, self.controller = method, controller

    def reset(self, simulator: Simulator) -> None:
        """Predicts the motions of all episodes, for as long as the task lasts."""
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
        """Returns what was not finite in the motions of a chunk that begins at that row."""
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
        """Tells the method where the episodes begin."""
        begin(self.method, simulator.state())
        self._starts, self._first = 0, 0

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the method's actions (B, A)."""
        acted = actions(self.method, simulator.state(), step)
        bad = _non_finite(acted)
        count = int((bad & simulator.running).sum())  # none of them runs any longer
        self._first = self._first if self._starts else step
        self._starts += count
        return _diverging(acted, bad)

    def non_finite(self, row: int) -> tuple[NonFinite, ...]:
        """Returns what was not finite in the actions of a chunk that begins at that row."""
        return (NonFinite(row, "act", self._starts, self._first),) if self._starts else ()


def _non_finite(answers: FloatArray) -> BoolArray:
    """Where an answer (..., K) has numbers that are not finite, (...)."""
    return np.asarray(~np.isfinite(answers).all(axis=-1))


def _diverging(acted: FloatArray, bad: BoolArray) -> FloatArray:
    """Actions with which the bad episodes diverge: infinite ones would be clipped."""
    return np.where(bad[:, None], np.nan, acted)
