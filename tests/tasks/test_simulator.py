import numpy as np
import pytest

from tasks.data import FloatArray, generator
from tasks.errors import InputError
from tasks.experts import load_expert
from tasks.registry import PUBLISHED, TASKS, get_task, rules
from tasks.simulator import Simulator, rollout

EPISODES = 20


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    """Runs each test in an empty folder and checks that it stays empty."""
    monkeypatch.chdir(tmp_path)
    yield
    assert not list(tmp_path.iterdir())


@pytest.fixture(params=[(name, rule) for name in TASKS for rule in rules(name)], ids="-".join)
def judged(request):
    """A task with each of its success rules."""
    return get_task(*request.param)


class Broken:
    """Holds still, except for a broken action in some episodes at one step."""

    def __init__(self, task, rows: list[int], step: int, value: float = np.nan):
        self.action_dim = task.layout.action_dim
        self.rows, self.step, self.value = rows, step, value

    def reset(self, simulator: Simulator) -> None:
        self.broken = np.isin(simulator.starts.index, self.rows)

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        actions = np.zeros((len(simulator.starts), self.action_dim))
        if step == self.step:
            actions[self.broken, 3] = self.value
        return actions


def test_outcomes_do_not_depend_on_chunks_or_threads(task, random_replay):
    starts, policy = task.sample("test", EPISODES), random_replay(task, EPISODES)
    expected = rollout(task, starts, policy, chunk=EPISODES, threads=2)
    assert not expected.diverged.any()
    for n, chunk, threads in ((2, 1, 2), (EPISODES, 7, 1), (EPISODES, 500, 1)):
        got = rollout(task, starts[:n], policy, chunk=chunk, threads=threads)
        np.testing.assert_array_equal(got.readings, expected.readings[:n])
        np.testing.assert_array_equal(got.success, expected.success[:n])
        np.testing.assert_array_equal(got.steps, expected.steps[:n])


def test_stopped_episodes_keep_their_state_and_do_not_affect_others(task, random_replay):
    starts, policy = task.sample("test", 6), random_replay(task, 6)
    all_run, some_run = Simulator(task, starts), Simulator(task, starts)
    policy.reset(all_run)
    before = some_run.state()
    some_run.running[[1, 4]] = False
    for step in range(30):
        actions = policy.act(all_run, step)
        all_run.step(actions)
        some_run.step(actions)
    run = some_run.running
    np.testing.assert_array_equal(some_run.state()[run], all_run.state()[run])
    np.testing.assert_array_equal(some_run.state()[~run], before[~run])


def test_ending_decided_episodes_early_does_not_change_success(judged, random_replay):
    task = judged
    starts, policy = task.sample("test", EPISODES), random_replay(task, EPISODES)
    whole = rollout(task, starts, policy, whole=True)
    ended = rollout(task, starts, policy)
    np.testing.assert_array_equal(ended.success, whole.success)
    assert (whole.steps == task.steps).all()
    counted = task.name in ("relocation", "reorientation")
    assert (ended.steps < whole.steps).any() == counted
    there = np.arange(task.steps) < ended.steps[:, None]
    np.testing.assert_array_equal(ended.readings[there], whole.readings[there])
    assert np.isnan(ended.readings[~there]).all()


def test_success_is_decided_when_no_later_reading_can_change_it(judged):
    task = judged
    rng = generator("decided", task.name)
    low, high = {"relocation": (0.08, 0.12), "reorientation": (0.88, 0.92)}.get(task.name, (0, 2))
    readings = rng.uniform(low, high, (50, 30))
    if judged.name == "reorientation":
        readings[:25] -= 4.0 * rng.integers(0, 2, (25, 30))  # readings of an unsettled pen
    for taken in range(1, 31):
        ends = [readings.copy() for _ in range(2)]
        for end, value in zip(ends, (-1e6, 1e6), strict=True):
            end[:, taken:] = value
        same = task.success(ends[0]) == task.success(ends[1])
        np.testing.assert_array_equal(task.decided(readings[:, :taken], 30 - taken), same)


def test_a_policy_always_sees_a_full_chunk(task):
    seen = []

    class Counting(Broken):
        def act(self, simulator, step):
            seen.append(len(simulator.starts))
            return super().act(simulator, step)

    starts = task.sample("test", 5)
    episodes = rollout(task, starts, Counting(task, [], 0), steps=2, chunk=4, whole=True)
    assert set(seen) == {4}
    assert len(episodes.success) == 5
    np.testing.assert_array_equal(episodes.steps, 2)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_nan_action_diverges_and_an_infinite_one_is_clipped(task, value):
    starts = task.sample("test", 5)
    policy = Broken(task, [1, 3], step=2, value=value)
    episodes = rollout(task, starts, policy, steps=6, whole=True)
    broken = np.array([False, True, False, True, False]) & np.isnan(value)
    np.testing.assert_array_equal(episodes.diverged, broken)
    np.testing.assert_array_equal(episodes.steps, np.where(broken, 2, 6))
    np.testing.assert_array_equal(np.isnan(episodes.readings[:, 2:]).all(axis=1), broken)


@pytest.mark.parametrize("field", ["qpos", "qvel"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e12])
def test_a_state_that_is_not_finite_or_huge_diverges(task, field, value):
    simulator = Simulator(task, task.sample("test", 4))
    getattr(simulator.batch, field)[2, 0] = value
    simulator.step(np.zeros((4, task.layout.action_dim)))
    np.testing.assert_array_equal(simulator.diverged, [False, False, True, False])
    np.testing.assert_array_equal(np.isnan(simulator.read()), simulator.diverged)
    assert np.isfinite(simulator.state()).all()
    assert np.isfinite(simulator.observe()).all()


def test_a_state_that_the_next_step_would_warn_about_diverges(task):
    simulator = Simulator(task, task.sample("test", 3))
    simulator.step(np.zeros((3, task.layout.action_dim)))
    simulator.batch.qpos[1, 5] = np.nan
    simulator.mark_diverged()
    np.testing.assert_array_equal(simulator.diverged, [False, True, False])


def test_an_episode_that_diverges_after_success_fails():
    task = get_task("reorientation")
    starts = task.sample("ood", 400)
    facing = starts[np.flatnonzero(starts.values[:, 1] > 1.17)]
    still = rollout(task, facing, Broken(task, [], 0))
    late = Broken(task, facing.index.tolist(), step=task.horizon - 2)
    broken = rollout(task, facing, late, whole=True)
    assert still.success.any()
    assert task.success(broken.readings).any()
    assert broken.diverged.all()
    assert not broken.success.any()


def test_readings_that_are_nan_never_succeed(task):
    assert not task.success(np.full((3, task.horizon - 1), np.nan)).any()


RULES = {
    # readings after each step, and whether they meet the rule of appendix C
    "tool": [([0.5, 0.0099], True), ([0.0, 0.01], False)],
    "door": [([0.0, 1.351], True), ([1.4, 1.35], False)],
    "relocation": [([0.0999] * 11 + [1.0], True), ([0.0999] * 10 + [0.1], False)],
    "reorientation": [([0.901] * 11 + [0.0], True), ([0.901] * 10 + [0.9], False)],
}


def test_success_follows_appendix_c(task):
    for readings, expected in RULES[task.name]:
        assert task.success(np.array([readings]))[0] == expected


@pytest.mark.parametrize("shape", [(3,), (2, 24), (3, 5), (3, 1, 24)])
def test_actions_of_a_wrong_shape_are_refused(task, shape):
    simulator = Simulator(task, task.sample("test", 3))
    with pytest.raises(InputError, match=rf"\(B, A\) = \(3, {task.layout.action_dim}\)"):
        simulator.step(np.zeros(shape))


@pytest.mark.parametrize("dtype", [complex, object, str])
def test_actions_that_are_not_real_are_refused(dtype):
    task = get_task("door")
    simulator = Simulator(task, task.sample("test", 3))
    with pytest.raises(InputError, match="actions of door must hold real numbers"):
        simulator.step(np.zeros((3, task.layout.action_dim)).astype(dtype))


def test_starts_are_checked_before_anything_runs(task):
    starts = task.sample("test", 3)
    with pytest.raises(InputError, match="at least one start"):
        Simulator(task, starts[:0])
    starts.values[1] = -9.0
    with pytest.raises(InputError, match="start 1"):
        Simulator(task, starts)


@pytest.mark.parametrize("argument", ["steps", "chunk"])
def test_a_rollout_without_steps_or_episodes_per_chunk_is_refused(task, argument):
    with pytest.raises(InputError, match=f"{argument} must be 1 or more, got 0"):
        rollout(task, task.sample("test", 1), Broken(task, [], 0), **{argument: 0})


def test_published_tool_judges_the_same_motion_after_30_steps():
    task = get_task("tool")
    starts, expert = task.sample("probe", 20), load_expert(task).policy
    whole = rollout(task, starts, expert)
    early = rollout(get_task("tool", PUBLISHED), starts, expert)
    np.testing.assert_array_equal(early.readings, whole.readings[:, :30])
    np.testing.assert_array_equal(early.success, whole.readings[:, 29] < 0.01)


class Clumsy:
    """Turns the pen as the expert does, then lets some pens fall, and shakes others at the end."""

    def __init__(self, task):
        self.expert = load_expert(task).policy

    def reset(self, simulator: Simulator) -> None:
        self.kind = simulator.starts.index % 3

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        actions = self.expert.act(simulator, step)
        if step >= 50:
            actions[self.kind == 1] = -1.0
        if step >= 95:
            actions[self.kind == 2] = 1.0 if step % 2 else -1.0
        return actions


def test_published_reorientation_requires_a_held_and_slow_pen():
    task = get_task("reorientation", PUBLISHED)
    starts, policy = task.sample("ood", 60), Clumsy(task)
    simulator, aligned = Simulator(task, starts), []
    policy.reset(simulator)
    for step in range(99):
        simulator.step(policy.act(simulator, step))
        aligned.append(get_task("reorientation").read(simulator.batch) > 0.9)
    slow = np.abs(simulator.batch.qvel[:, 24:30]).mean(axis=1) < 1.0
    height = simulator.batch.body("Object").xpos - simulator.batch.site("eps_ball").xpos
    held = np.abs(height[:, 2]) <= 0.15
    expected = (np.sum(aligned, axis=0) > 10) & slow & held
    np.testing.assert_array_equal(rollout(task, starts, policy).success, expected)
    oriented = np.sum(aligned, axis=0) > 10
    for settled in (slow, held, slow & held):
        assert oriented.sum() > (oriented & settled).sum() > 0
    assert (slow != held).any()


def test_an_unknown_success_rule_is_refused():
    with pytest.raises(InputError, match="door"):
        get_task("door", PUBLISHED)
