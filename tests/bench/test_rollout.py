import numpy as np
import pytest
from numpy.testing import assert_array_equal

from bench.controller import Controller
from bench.rollout import FeedbackPolicy, TrackedMotion
from methods.contract import ContractError
from tasks.data import NonFinite
from tasks.disturbed import disturbed
from tasks.experts import load_expert
from tasks.registry import get_task
from tasks.simulator import Simulator, rollout

DOOR = get_task("door")


class Answering:
    """A method whose every answer is an array of zeros of some type."""

    def __init__(self, dtype):
        self.dtype = dtype

    def reset(self, starts, rngs):
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


def still(task):
    """The weights of a controller whose every action is 0."""
    width = task.layout.action_dim
    return {
        "layer0.weight": np.zeros((width, 2 * task.robot_dim), np.float32),
        "layer0.bias": np.zeros(width, np.float32),
    }


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    ("policy_of", "call", "steps"),
    [
        (FeedbackPolicy, "act", 3),
        (lambda method: TrackedMotion(method, Controller(still(DOOR))), "rollout", 2),
    ],
)
def test_a_non_finite_answer_ends_its_episode_and_is_counted(value, policy_of, call, steps):
    policy = policy_of(Spoilt(value))
    episodes = rollout(DOOR, DOOR.sample("test", 4), policy, steps=6, chunk=8)
    assert episodes.diverged.tolist() == [True, True, False, False]
    assert episodes.steps.tolist() == [steps, steps, 6, 6]
    assert not episodes.success.any()
    assert policy.non_finite(500) == (NonFinite(500, call, 2, 3),)


@pytest.mark.parametrize("late", [1, 2])
def test_an_episode_whose_bad_answer_arrives_late_is_counted_once(late):
    policy = FeedbackPolicy(Spoilt(np.nan))
    driver = disturbed(policy, f"late_{late}", DOOR)
    episodes = rollout(DOOR, DOOR.sample("test", 4), driver, steps=8, chunk=8)
    assert episodes.steps.tolist() == [3 + late, 3 + late, 8, 8]
    assert policy.non_finite(0) == (NonFinite(0, "act", 2, 3),)


class Copied:
    """Controller that takes the actions of the expert, and a method whose last row is spoilt."""

    def __init__(self, task, starts):
        self.layout = task.layout
        expert, simulator = load_expert(task).policy, Simulator(task, starts, threads=1)
        self.taken = []
        for step in range(task.steps):
            self.taken.append(np.clip(expert.act(simulator, step), -1, 1))
            simulator.step(self.taken[-1])

    def rollout(self, start, steps):
        motion = np.zeros((len(start), steps + 1, self.layout.robot_dim))
        motion[:, -1] = np.nan
        return motion

    def act(self, joints, following):
        return self.taken.pop(0)


def test_an_answer_that_no_step_used_is_not_counted():
    task = get_task("relocation")
    starts = task.sample("test", 4, 1)
    copied = Copied(task, starts)
    policy = TrackedMotion(copied, copied)
    episodes = rollout(task, starts, policy, chunk=4)
    assert episodes.success.all()
    assert (episodes.steps < task.steps).all()
    assert policy.non_finite(0) == ()


def test_finite_answers_are_not_counted():
    policy = FeedbackPolicy(Spoilt(0.0))
    rollout(DOOR, DOOR.sample("test", 2), policy, steps=4, chunk=2)
    assert policy.non_finite(0) == ()


class Onward(Answering):
    """Each joint moves on by 0.01 at each step; it keeps from where, and how far, it was asked."""

    layout = DOOR.layout

    def __init__(self):
        self.asked = []

    def rollout(self, start, steps):
        self.asked.append((start, steps))
        hand = start[:, None, : DOOR.robot_dim]
        return hand + 0.01 * np.arange(steps + 1)[:, None]


class Wanted:
    """A controller that returns no motion, and keeps what it was asked for."""

    def __init__(self):
        self.pairs = []

    def act(self, present, wanted):
        self.pairs.append((present, wanted.copy()))
        return np.zeros((len(present), DOOR.layout.action_dim))


@pytest.mark.parametrize("replan", [1, 3])
def test_a_motion_is_predicted_anew_from_the_present_state(replan):
    method, controller, seen = Onward(), Wanted(), []
    policy = TrackedMotion(method, controller, replan)
    simulator = Simulator(DOOR, DOOR.sample("test", 2), threads=1)
    policy.reset(simulator)
    for step in range(7):
        seen.append(simulator.state())
        simulator.step(policy.act(simulator, step))
    begun = [*range(0, 7, replan)]
    assert [steps for _, steps in method.asked] == [DOOR.steps - step for step in begun]
    for (start, _), step in zip(method.asked, begun, strict=True):
        np.testing.assert_array_equal(start, seen[step])
    for step, (present, wanted) in enumerate(controller.pairs):
        np.testing.assert_array_equal(present, seen[step][:, : DOOR.robot_dim])
        since = step % replan
        expected = seen[step - since][:, : DOOR.robot_dim] + 0.01 * (since + 1)
        np.testing.assert_allclose(wanted, expected, atol=1e-12)
    np.testing.assert_array_equal(policy.motion[:, 6], seen[6][:, : DOOR.robot_dim])


def test_without_replanning_a_motion_is_predicted_once():
    method = Onward()
    policy = TrackedMotion(method, Wanted())
    rollout(DOOR, DOOR.sample("test", 2), policy, steps=5, chunk=2)
    assert len(method.asked) == 1


class SpoiltLater(Onward):
    """What it predicts anew is not finite two states later, in the second episode."""

    def rollout(self, start, steps):
        motion = super().rollout(start, steps)
        if len(self.asked) > 1:
            motion[1, 2:] = np.nan
        return motion


def test_a_new_motion_that_is_not_finite_is_counted_once_where_it_begins():
    policy = TrackedMotion(SpoiltLater(), Controller(still(DOOR)), replan=4)
    episodes = rollout(DOOR, DOOR.sample("test", 3), policy, steps=12, chunk=4)
    assert episodes.diverged.tolist() == [False, True, False]
    assert policy.non_finite(0) == (NonFinite(0, "rollout", 1, 6),)


class Closing:
    """A method whose motion closes the hand by its last step, as an NDP reaches its goal."""

    def __init__(self, layout):
        self.layout = layout

    def rollout(self, start, steps):
        joints = start[:, None, : self.layout.robot_dim]
        return joints + np.linspace(0, 1, steps + 1)[:, None]


def test_a_motion_is_the_same_under_a_rule_with_shorter_episodes():
    """The published rule judges Tool after 30 control steps, not after 99."""
    motions = {}
    for rule in ("appendix", "published"):
        task = get_task("tool", rule)
        policy = TrackedMotion(Closing(task.layout), Controller(still(task)))
        episodes = rollout(task, task.sample("test", 2, 1), policy, chunk=2)
        assert episodes.steps.tolist() == [task.steps] * 2
        motions[rule] = policy.motion
    assert motions["published"].shape[1] == 31
    assert_array_equal(motions["published"], motions["appendix"][:, :31])
