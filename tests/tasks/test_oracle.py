"""The tasks match the Adroit environments of gymnasium-robotics and plain MuJoCo."""

import contextlib
import io
import warnings

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tasks.data import Starts, generator
from tasks.simulator import Simulator

ENVIRONMENTS = {
    "tool": "AdroitHandHammer-v1",
    "door": "AdroitHandDoor-v1",
    "relocation": "AdroitHandRelocate-v1",
    "reorientation": "AdroitHandPen-v1",
}
RANDOM_EPISODES = 20


@pytest.fixture
def env(task):
    """The environment that the task's model and observation come from."""
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        import gymnasium
        import gymnasium_robotics

        gymnasium.register_envs(gymnasium_robotics)
        made = gymnasium.make(ENVIRONMENTS[task.name]).unwrapped
        made.reset(seed=0)
        yield made
        made.close()


def begin(env, task, start):
    """Sets the environment to a start of appendix D, as its own reset would."""
    mujoco.mj_resetData(env.model, env.data)
    model = env.model
    if task.name == "tool":
        model.body("nail_board").pos[2] = start[0]
    elif task.name == "door":
        model.body("frame").pos = start
    elif task.name == "relocation":
        model.body("Object").pos[:2] = 0.0
        model.site("target").pos = start
    else:
        # capital letters mean intrinsic rotations
        turn = Rotation.from_euler("XYZ", [*start, 0.0])
        model.body("target").quat = turn.as_quat(scalar_first=True)
    env.set_state(env.init_qpos, env.init_qvel)


def refreshed(env, data):
    """Returns a copy of the environment's data with current kinematics."""
    mujoco.mj_copyData(data, env.model, env.data)
    mujoco.mj_forward(env.model, data)
    return data


def own_observation(env, data):
    """Returns the environment's own observation of data with current kinematics."""
    lagging, env.data = env.data, data
    try:
        return env._get_obs()
    finally:
        env.data = lagging


def object_state(task, model, data):
    """Returns x_o of appendix B, component by component, from one MjData."""
    body, site, joint = data.body, data.site, data.joint
    velocity = [joint(f"OBJ{j}").qvel[0] for j in ("Tx", "Ty", "Tz", "Rx", "Ry", "Rz")]
    if task.name == "tool":
        turn = Rotation.from_quat(body("Object").xquat, scalar_first=True)
        clipped = [min(max(v, -1.0), 1.0) for v in velocity]
        return [*site("tool").xpos, *turn.as_euler("XYZ"), *clipped, *site("nail_goal").xpos]
    if task.name == "relocation":
        ball = body("Object").xpos - site("target").xpos
        return [*ball, *(joint(f"OBJR{axis}").qpos[0] for axis in "xyz"), *velocity]
    pen = site("object_top").xpos - site("object_bottom").xpos
    g1, g2, g3 = goal = (site("target_top").xpos - site("target_bottom").xpos) / 0.13
    a = 1 / np.sqrt(2 + ((g1 + g2) / g3) ** 2)
    y = np.array([a, a, -a * (g1 + g2) / g3])
    rotated = np.stack([goal, y, np.cross(goal, y)]) @ (pen / np.linalg.norm(pen))
    return [*body("Object").xpos, *rotated, *velocity]


def door_state(task, model, data):
    hinge = data.joint("door_hinge").qvel[0]
    return [*data.site("S_handle").xpos, hinge, *model.body("frame").pos]


def reading(task, data):
    site = data.site
    if task.name == "tool":
        return np.linalg.norm(site("S_target").xpos - site("nail_goal").xpos)
    if task.name == "door":
        return data.joint("door_hinge").qpos[0]
    if task.name == "relocation":
        return np.linalg.norm(data.body("Object").xpos - site("target").xpos)
    pen = site("object_top").xpos - site("object_bottom").xpos
    goal = site("target_top").xpos - site("target_bottom").xpos
    return pen @ goal / np.linalg.norm(pen) / np.linalg.norm(goal)


def action_sequences(task):
    """Full-length episodes: uniform noise, random walks, and one that jumps beyond the limits."""
    rng = generator("oracle actions", task.name)
    shape = (RANDOM_EPISODES // 2, task.horizon - 1, task.layout.action_dim)
    noise = rng.uniform(-1, 1, shape)
    walks = 0.2 * rng.standard_normal(shape).cumsum(axis=1)
    extreme = rng.choice([-3.0, 3.0], (1, *shape[1:]))
    return np.concatenate([noise, walks, extreme])


def test_episodes_match_the_environments_bit_for_bit(task, env):
    actions = action_sequences(task)
    n = len(actions)
    unseen, ood = task.sample("test", n), task.sample("ood", n // 2)
    data = mujoco.MjData(env.model)
    for starts, rows in ((unseen, range(n)), (ood, range(3))):
        simulator = Simulator(task, starts[list(rows)], threads=2)
        trace = [snapshot(simulator)]
        for step in range(task.horizon - 1):
            simulator.step(actions[list(rows), step])
            trace.append(snapshot(simulator))
        assert not simulator.diverged.any()
        for row in rows:
            begin(env, task, starts.values[row])
            compare(task, env, data, [part[row] for part in trace[0]])
            for step in range(task.horizon - 1):
                env.step(actions[row, step])
                compare(task, env, data, [part[row] for part in trace[step + 1]])


def snapshot(simulator):
    batch = simulator.batch
    state, read = simulator.state(), simulator.read()
    return batch.qpos.copy(), batch.qvel.copy(), state, read, simulator.observe()


def compare(task, env, data, ours):
    qpos, qvel, state, read, observation = ours
    np.testing.assert_array_equal(qpos, env.data.qpos)
    np.testing.assert_array_equal(qvel, env.data.qvel)
    fresh = refreshed(env, data)
    x_o = (door_state if task.name == "door" else object_state)(task, env.model, fresh)
    np.testing.assert_array_equal(state[: task.robot_dim], fresh.qpos[: task.robot_dim])
    # NumPy, SciPy and the environment round products of quaternions differently
    np.testing.assert_allclose(state[task.robot_dim :], x_o, rtol=0, atol=1e-12)
    np.testing.assert_allclose(read, reading(task, fresh), rtol=0, atol=1e-12)
    np.testing.assert_allclose(observation, own_observation(env, fresh), rtol=0, atol=1e-12)


def test_dimensions_match_appendix_b(task):
    table = {
        "tool": (26, 15, 26, 100, 46),
        "door": (28, 7, 28, 70, 39),
        "relocation": (30, 12, 30, 100, 39),
        "reorientation": (24, 12, 24, 100, 45),
    }
    simulator = Simulator(task, task.sample("test", 2))
    layout = task.layout
    observed = simulator.observe().shape
    dimensions = (layout.robot_dim, layout.object_dim, layout.action_dim, task.horizon, observed[1])
    assert dimensions == table[task.name]
    assert simulator.state().shape == (2, layout.state_dim)
    assert len(task.components) == layout.state_dim


@pytest.mark.parametrize("task", ["tool"], indirect=True)
def test_the_nail_sensor_is_computed_wherever_a_body_touches_the_nail(task, env):
    n = 60
    starts = Starts("tool", "test", np.arange(n), np.linspace(0.1, 0.25, n)[:, None])
    simulator = Simulator(task, starts)
    to_nail = simulator.batch.site("S_target").xpos - simulator.batch.site("tool").xpos
    jitter = generator("hammer poses").uniform(-0.06, 0.06, (n, 3))
    turn = Rotation.from_quat(task.model.body("Object").quat, scalar_first=True)
    # the slides of the hammer lie along the axes of its body
    simulator.batch.qpos[:, 27:30] = turn.inv().apply(to_nail + jitter)
    simulator.batch.forward()
    impact = simulator.observe()[:, -1]
    data = mujoco.MjData(env.model)
    expected = []
    for start, qpos in zip(starts.values, simulator.batch.qpos, strict=True):
        begin(env, task, start)
        env.set_state(qpos, np.zeros(env.model.nv))
        expected.append(own_observation(env, refreshed(env, data))[-1])
    np.testing.assert_array_equal(impact, expected)
    assert 0.1 * n < np.count_nonzero(impact) < 0.9 * n
