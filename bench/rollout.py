"""One policy, one task, one list of starts: what drives a rollout."""

from bench.controller import Controller
from methods.base import ActionMethod, MotionMethod
from tasks.data import FloatArray, real
from tasks.simulator import Simulator


class TrackedMotion:
    """A motion that a method predicts from the start, tracked by the controller (appendix A)."""

    def __init__(self, method: MotionMethod, controller: Controller) -> None:
        self.method, self.controller = method, controller

    def reset(self, simulator: Simulator) -> None:
        """Predicts the motions of all episodes, for as long as the task lasts."""
        task = simulator.task
        motion = real(
            f"motions of {type(self.method).__name__}",
            self.method.rollout(simulator.state(), task.steps),
        )
        self.motion = motion[:, :, : task.robot_dim]

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the controller's actions (B, A) towards the next row of the motion."""
        present = simulator.batch.qpos[:, : simulator.task.robot_dim]
        return self.controller.act(present, self.motion[:, step + 1])


class FeedbackPolicy:
    """A method that answers each state with an action."""

    def __init__(self, method: ActionMethod) -> None:
        self.method = method

    def reset(self, simulator: Simulator) -> None:
        """Tells the method where the episodes begin."""
        self.method.reset(simulator.state())

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the method's actions (B, A)."""
        actions = self.method.act(simulator.state(), step)
        return real(f"actions of {type(self.method).__name__}", actions)
