"""Measures how well an expert's demonstrations can be imitated, before the expert is shipped.

There are two probes. (a) The controller, trained on the training demonstrations, tracks the
recorded motions of the validation demonstrations. Its success is what a perfect method could reach.
(b) KODex, fitted to the training demonstrations, runs from the starts of ``probe``. Its success is
a minimum to pass, and does not rank experts.
"""

from typing import Any

import numpy as np

from bench.controller import Controller, ControllerConfig, train_controller
from bench.doing import say
from bench.rollout import TrackedMotion
from methods.base import MotionMethod, Parameters
from methods.kodex import Kodex
from tasks.base import Task
from tasks.data import Demos, FloatArray, Layout
from tasks.demos import TRAINING, VALIDATION, split
from tasks.recorder import make_demos
from tasks.simulator import Policy, rollout
from tasks.words import count_of


class Recorded(MotionMethod):
    """Predicts the recorded demonstration that began at the start."""

    name = "recorded"

    def __init__(self, demos: Demos) -> None:
        robot_dim, (*_, state_dim) = demos.velocities.shape[-1], demos.states.shape
        layout = Layout(robot_dim, state_dim - robot_dim, demos.actions.shape[-1])
        super().__init__(None, layout)
        self._states = demos.states

    def rollout(self, start: FloatArray, steps: int) -> FloatArray:
        """Returns the recorded states (B, steps + 1, D) of the nearest start."""
        apart = np.abs(start[:, None] - self._states[:, 0]).max(axis=-1)
        return self._states[apart.argmin(axis=1), : steps + 1]

    def fit(self, demos: Demos, validation: Demos, seed: int) -> None:
        """Does nothing: there is nothing to learn."""

    def parameters(self) -> Parameters:
        """Returns no parameters: nothing is learnt."""
        return {}

    def load(self, parameters: Parameters) -> None:
        """Does nothing: there are no parameters."""


def probe(task: Task, expert: Policy, episodes: int, config: ControllerConfig) -> dict[str, Any]:
    """Returns the success of both probes of an expert, and how rough its demonstrations are.

    Args:
        task: the task.
        expert: the policy that demonstrates.
        episodes: number of starts of ``probe`` for (b).
        config: training settings of the controller.
    """
    say(f"recording demonstrations of {task.name}")
    demos = make_demos(task, expert, TRAINING + VALIDATION)
    training, validation = split(demos)
    say("training the controller")
    controller = Controller(train_controller(config, training, task.name))
    kodex = Kodex(Kodex.sizes["single"], task.layout)
    kodex.fit(training, validation, 0)
    say(f"evaluating the controller and KODex in {count_of(episodes, 'episode')}")
    tracked = rollout(task, validation.starts, TrackedMotion(Recorded(validation), controller))
    starts = task.sample("probe", episodes)
    imitated = rollout(task, starts, TrackedMotion(kodex, controller))
    eigenvalues = kodex.diagnostics()["eigenvalues"]
    return {
        "task": task.name,
        "tracked_validation_motions": float(tracked.success.mean()),
        "kodex_success": float(imitated.success.mean()),
        "kodex_largest_eigenvalue": float(np.hypot(*eigenvalues.T).max()),
        "episodes": episodes,
        "starts_tried": int(demos.starts.index[-1]) + 1,
        "mean_squared_action_change": float((np.diff(demos.actions, axis=1) ** 2).mean()),
        "mean_squared_hand_velocity": float((demos.velocities**2).mean()),
    }
