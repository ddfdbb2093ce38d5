import numpy as np
import pytest

from bench.controller import Controller
from bench.rollout import FeedbackPolicy, TrackedMotion
from methods.contract import ContractError
from tasks.data import NonFinite
from tasks.registry import get_task
from tasks.simulator import Simulator, rollout

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


class Spoilt(Answering):
    """Its answers are not finite from t = 3 on, in the first two episodes."""

    layout = DOOR.layout

    def __init__(self, value):
        self.value = value

    def act(self, state, t):
        actions = np.zeros((len(state), DOOR.layout.action_dim))
        actions[: 2 * (t >= 3), 0] = self.value
        return actions

    def rollout(self, start, steps):
        motion = np.repeat(start[:, None, : DOOR.robot_dim], steps + 1, axis=1)
        motion[:2, 3:, 0] = self.value
        return motion


STILL = {
    "layer0.weight": np.zeros((DOOR.layout.action_dim, 2 * DOOR.robot_dim), np.float32),
    "layer0.bias": np.zeros(DOOR.layout.action_dim, np.float32),
}


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    ("policy_of", "call", "steps"),
    [
        (FeedbackPolicy, "act", 3),
        (lambda method: TrackedMotion(method, Controller(STILL)), "rollout", 2),
    ],
)
def test_a_non_finite_answer_ends_its_episode_and_is_counted(value, policy_of, call, steps):
    policy = policy_of(Spoilt(value))
    episodes = rollout(DOOR, DOOR.sample("test", 4), policy, steps=6, chunk=8)
    assert episodes.diverged.tolist() == [True, True, False, False]
    assert episodes.steps.tolist() == [steps, steps, 6, 6]
    assert not episodes.success.any()
    assert policy.non_finite(500) == (NonFinite(500, call, 2, 3),)


def test_finite_answers_are_not_counted():
    policy = FeedbackPolicy(Spoilt(0.0))
    rollout(DOOR, DOOR.sample("test", 2), policy, steps=4, chunk=2)
    assert policy.non_finite(0) == ()
