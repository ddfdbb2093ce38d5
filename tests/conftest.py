from dataclasses import dataclass

import pytest
from hypothesis import settings

from tasks.data import FloatArray, generator
from tasks.registry import TASKS, get_task
from tasks.simulator import Simulator

# The machine may be busy, and a test that passes once must pass again.
settings.register_profile("suite", deadline=None, derandomize=True)
settings.load_profile("suite")


@pytest.fixture(params=TASKS)
def task(request):
    return get_task(request.param)


@dataclass
class Replay:
    """A policy that plays back actions (N, T-1, A), one row for each start index."""

    actions: FloatArray

    def reset(self, simulator: Simulator) -> None:
        self.rows = simulator.starts.index

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        return self.actions[self.rows, step]


@pytest.fixture
def random_replay():
    """Makes a Replay of smooth random actions, which move the hand and what it touches."""

    def make(task, n: int, steps: int | None = None) -> Replay:
        return Replay(random_actions(task, n, steps))

    return make


def random_actions(task, n: int, steps: int | None = None) -> FloatArray:
    steps = task.horizon - 1 if steps is None else steps
    rng = generator("test actions", task.name)
    noise = rng.standard_normal((n, steps, task.layout.action_dim))
    return 0.3 * noise.cumsum(axis=1)
