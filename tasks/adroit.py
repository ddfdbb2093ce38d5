"""The tasks on the Adroit hand, whose models gymnasium-robotics ships."""

import importlib.util
from abc import abstractmethod
from functools import cached_property
from pathlib import Path

from mujoco.batch import Batch

from tasks.base import Task
from tasks.data import FloatArray
from tasks.errors import InputError
from tasks.masses import VARIATIONS


class AdroitTask(Task):
    """A task whose ``model_file`` lies in the Adroit folder of gymnasium-robotics."""

    @cached_property
    def model_path(self) -> Path:
        """Path of the model in gymnasium-robotics, found without importing that package.

        Raises:
            InputError: gymnasium-robotics is not installed, or lacks the file.
        """
        package = importlib.util.find_spec("gymnasium_robotics")
        if package is None or package.origin is None:
            raise InputError("gymnasium-robotics is not installed: it holds the Adroit models")
        path = Path(package.origin).parent / "envs/assets/adroit_hand" / self.model_file
        if not path.is_file():
            raise InputError(f"gymnasium-robotics has no {self.model_file} at {path}")
        return path

    def servo_gain(self, actuator: str) -> float | None:
        """Returns the gain that the Adroit environments set for wrist and fingers."""
        if actuator.startswith("A_AR"):  # the arm
            return None
        return 10.0 if actuator.startswith("A_WR") else 1.0

    @property
    def variations(self) -> tuple[str, ...]:
        """Those of appendix I; only the experiment `readings` compares others of it."""
        return VARIATIONS

    @abstractmethod
    def observe(self, batch: Batch) -> FloatArray:
        """Returns the observation of the task's gymnasium-robotics environment, a row per episode.

        Its kinematics are current; the environment's own lag by one substep.
        """
