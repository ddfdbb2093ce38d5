import numpy as np
import pytest

from bench.rollout import FeedbackPolicy, TrackedMotion
from methods.contract import ContractError
from tasks.registry import get_task
from tasks.simulator import Simulator

DOOR = get_task("door")


class Answering:
    """A method whose every answer is an array of zeros of some type."""

    def __init__(self, dtype):
        self.dtype = dtype

    def reset(self, starts):
        pass

    def act(self, state, t):
        return np.zeros((len(state), DOOR.layout.action_dim)).astype(self.dtype)

    def rollout(self, start, steps):
        return np.zeros((len(start), steps + 1, DOOR.robot_dim)).astype(self.dtype)


@pytest.mark.parametrize("dtype", [complex, object, str])
def test_answers_of_a_method_that_are_not_real_are_refused(dtype):
    simulator, method = Simulator(DOOR, DOOR.sample("test", 2)), Answering(dtype)
    method.layout = DOOR.layout
    with pytest.raises(ContractError, match="act must return a NumPy array of floats"):
        FeedbackPolicy(method).act(simulator, 0)
    with pytest.raises(ContractError, match="rollout must return a NumPy array of floats"):
        TrackedMotion(method, None).reset(simulator)
