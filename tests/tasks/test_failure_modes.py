"""Failure modes: recordings with known modes, and properties of every recording."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tasks.base import DIVERGED
from tasks.data import Episodes, Starts, generator
from tasks.door import AJAR_ANGLE, RELEASE_ANGLE
from tasks.registry import TASKS, get_task, rules
from tasks.simulator import Simulator, rollout

RULES = [(task, rule) for task in TASKS for rule in rules(task)]


def episodes(task, readings, diverged=None):
    diverged = np.zeros(len(readings), bool) if diverged is None else diverged
    starts = task.sample("test", len(readings))
    success = task.success(readings) & ~diverged
    return Episodes(starts, success, diverged, np.full(len(readings), task.steps), readings)


def mode(task, readings, *watched, diverged=False):
    """Returns the failure mode of one episode; pads short recordings with their last value."""
    full = [np.pad(np.asarray(one, float), (0, task.steps - len(one)), "edge") for one in watched]
    ended = np.pad(
        np.asarray(readings, float),
        (0, task.steps - len(readings)),
        "constant" if np.isnan(readings[-1]) else "edge",
        **({"constant_values": np.nan} if np.isnan(readings[-1]) else {}),
    )
    found = episodes(task, ended[None], np.array([diverged]))
    return str(task.modes(found, np.stack(full, axis=-1)[None])[0])


def test_door_failure_modes():
    door = get_task("door")
    assert mode(door, [0.0, 1.4], [0.0, 1.9], [0.05, 0.4]) == ""
    assert mode(door, [0.0, 0.1], [0.0, 1.1], [0.05, 0.05]) == "latch not turned"
    assert mode(door, [0.0, 0.3], [1.9, 0.0], [0.05, 0.3]) == "hand lost the handle"
    assert mode(door, [0.0, 1.2], [0.0, 1.9], [0.05, 0.3]) == "opened too little"
    assert mode(door, [0.0, 0.3], [0.0, 1.9], [0.3, 0.05]) == "opened too little"
    assert mode(door, [0.0, np.nan], [0.0, np.nan], [0.1, np.nan], diverged=True) == DIVERGED


def test_tool_failure_modes():
    tool = get_task("tool")
    assert mode(tool, [0.09, 0.005], [0.03, 0.2]) == ""
    assert mode(tool, [0.09, 0.0905], [0.03, 0.03]) == "nail not reached"
    assert mode(tool, [0.09, 0.08, 0.09], [0.03, 0.2]) == "not driven far enough"
    assert mode(tool, [0.09, 0.05], [0.03, 0.2, 0.03]) == "hammer dropped"
    assert mode(tool, [0.09, 0.05], [0.03, 0.045, 0.03]) == "not driven far enough"


def test_relocation_failure_modes():
    relocation = get_task("relocation")
    assert mode(relocation, [0.3, 0.05], [0.03, 0.2]) == ""
    assert mode(relocation, [0.3], [0.035, 0.06, 0.035]) == "not lifted"
    assert mode(relocation, [0.3], [0.035, 0.2, -0.9]) == "dropped"
    assert mode(relocation, [0.3], [0.035, 0.2]) == "not brought there"
    assert mode(relocation, [0.3, *[0.05] * 10, 0.3], [0.035, 0.2]) == "not kept there"


def test_reorientation_failure_modes():
    reorientation = get_task("reorientation")
    assert mode(reorientation, [0.3, 0.95], [0.0]) == ""
    assert mode(reorientation, [0.3], [0.0, -0.2, 0.0]) == "dropped"
    assert mode(reorientation, [0.3, 0.9], [0.0]) == "not turned"
    assert mode(reorientation, [0.3, 0.95, 0.3], [0.0]) == "left again"
    assert mode(reorientation, [*[0.3] * 98, 0.95], [0.0]) == "turned too late"
    early = [*[0.3] * 90, 0.95, np.nan]  # ended early: ten more steps would not suffice
    assert mode(reorientation, early, [0.0]) == "turned too late"


def test_published_reorientation_requires_a_pen_at_rest():
    published = get_task("reorientation", "published")
    assert mode(published, [0.95] * 98 + [0.95 - 4], [0.0]) == "not settled at the end"
    assert mode(published, [0.3], [0.0]) == "not turned"
    assert mode(published, [0.95 - 4, 0.3], [0.0]) == "left again"


@pytest.mark.parametrize(("name", "rule"), RULES)
@given(data=st.data())
def test_an_episode_has_a_failure_mode_if_and_only_if_it_failed(name, rule, data):
    task = get_task(name, rule)
    near = {"tool": 0.01, "door": 1.35, "relocation": 0.1, "reorientation": 0.9}[name]
    values = st.one_of(st.floats(-4, 2), st.floats(near - 0.01, near + 0.01))
    readings = data.draw(arrays(float, (2, task.steps), elements=values))
    width = len(task.watched)
    watched = data.draw(arrays(float, (2, task.steps, width), elements=st.floats(-1, 2)))
    diverged = data.draw(arrays(bool, 2))
    end = data.draw(st.integers(0, task.steps))
    readings[diverged, end:] = watched[diverged, end:] = np.nan
    found = episodes(task, readings, diverged)
    modes = task.modes(found, watched)
    assert ((modes == "") == found.success).all()
    assert ((modes == DIVERGED) == diverged).all()
    assert set(modes) <= {"", DIVERGED, *task.failure_modes}


@pytest.mark.parametrize("name", TASKS)
def test_watched_quantities_match_the_model(name):
    task = get_task(name)
    simulator = Simulator(task, task.sample("test", 3))
    simulator.step(generator("watched", name).uniform(-1, 1, (3, task.layout.action_dim)))
    data = simulator.batch.get_data(1)
    mujoco.mj_forward(simulator.batch.get_model(1), data)
    expected = {
        "door": lambda d: [d.joint("latch").qpos[0], distance(d, "S_grasp", "S_handle")],
        "tool": lambda d: [d.body("Object").xpos[2]],
        "relocation": lambda d: [d.body("Object").xpos[2]],
        "reorientation": lambda d: [d.body("Object").xpos[2] - d.site("eps_ball").xpos[2]],
    }[name]
    found = task.watch(simulator.batch)
    assert found.shape == (3, len(task.watched))
    np.testing.assert_allclose(found[1], expected(data), atol=1e-12)


def distance(data, one, other):
    return np.linalg.norm(data.site(one).xpos - data.site(other).xpos)


@pytest.mark.parametrize(("held", "opens"), [(RELEASE_ANGLE - 0.1, False), (1.3, True)])
def test_the_door_opens_only_with_the_latch_past_the_release_angle(held, opens):
    model = get_task("door").model
    data = mujoco.MjData(model)
    hinge, latch = model.joint("door_hinge"), model.joint("latch")
    for _ in range(500):
        data.qpos[latch.qposadr[0]], data.qvel[latch.dofadr[0]] = held, 0.0
        data.qfrc_applied[hinge.dofadr[0]] = 10.0
        mujoco.mj_step(model, data)
    assert (data.qpos[hinge.qposadr[0]] > AJAR_ANGLE) is np.bool_(opens)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("door", "latch not turned"),
        ("tool", "nail not reached"),
        ("relocation", "not lifted"),
    ],
)
def test_a_hand_at_rest_has_the_first_failure_mode(name, expected):
    task = get_task(name)

    class Rest:
        def reset(self, simulator):
            self.watched = []

        def act(self, simulator, step):
            self.watched.append(task.watch(simulator.batch))
            return np.zeros((2, task.layout.action_dim))

    rest = Rest()
    found = rollout(task, task.sample("test", 2), rest, chunk=2)
    assert set(task.modes(found, np.stack(rest.watched, axis=1))) == {expected}


def test_a_task_without_failure_modes_has_a_default_one():
    class Plain(type(get_task("door"))):
        watched = ()
        failure_modes = ("rule not met",)

        def failed_by(self, readings, watched):
            return []

    plain = Plain()
    starts = Starts("door", "test", np.arange(2), plain.sample("test", 2).values)
    readings = np.array([[1.4], [0.2]])
    found = Episodes(starts, np.array([True, False]), np.zeros(2, bool), np.ones(2), readings)
    assert plain.modes(found, np.empty((2, 1, 0))).tolist() == ["", "rule not met"]
