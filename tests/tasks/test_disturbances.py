import mujoco
import numpy as np
import pytest

from tasks.data import join_episodes
from tasks.disturbances import KINDS, UNDISTURBED, find_disturbances, names_of
from tasks.disturbed import Disturbed
from tasks.errors import InputError
from tasks.experts import load_expert
from tasks.recorder import make_demos, record
from tasks.registry import TASKS, get_task
from tasks.simulator import Simulator, rollout

RELOCATION = get_task("relocation")


class Still:
    """Commands nothing new, and keeps what it reads."""

    def reset(self, simulator):
        self.states, self.commands = [simulator.state()], []

    def act(self, simulator, step):
        self.states.append(simulator.state())
        self.joints, self.observed = simulator.joints(), simulator.observe()
        self.velocities = simulator.velocities()
        self.commands.append(np.full((len(self.joints), simulator.task.layout.action_dim), step))
        return 0.01 * self.commands[-1]


def drive(name, steps, starts=None, policy=None, task=RELOCATION):
    policy = policy or Still()
    starts = task.sample("test", 4, 1) if starts is None else starts
    simulator = Simulator(task, starts, threads=1)
    disturbed = Disturbed(policy, find_disturbances(name, task))
    disturbed.reset(simulator)
    for step in range(steps):
        simulator.step(disturbed.act(simulator, step))
    return simulator, policy


def reset(name, task=RELOCATION, count=200):
    return drive(name, 0, task.sample("test", count, 1), task=task)[0]


def test_hinges_start_off_by_normal_errors_within_their_limits():
    model, moved = RELOCATION.model, reset("joints_off_0.05").batch.qpos
    slides, hinges = slice(0, 3), np.arange(3, RELOCATION.robot_dim)
    assert not moved[:, slides].any()
    low, high = model.jnt_range[hinges].T
    assert (moved[:, hinges] >= low).all()
    assert (moved[:, hinges] <= high).all()
    free = hinges[(low < -0.3) & (high > 0.3)]
    assert moved[:, free].std() == pytest.approx(0.05, rel=0.1)
    assert abs(moved[:, free].mean()) < 0.01


def test_errors_of_another_strength_are_the_same_but_for_their_size():
    weak, strong = (reset(f"joints_off_{s}").batch.qpos for s in (0.02, 0.04))
    wrist = slice(3, 6)
    np.testing.assert_allclose(2 * weak[:, wrist], strong[:, wrist], atol=1e-12)


@pytest.mark.parametrize("task", ["tool", "reorientation"])
def test_objects_start_elsewhere_in_the_horizontal_plane_of_the_world(task):
    task = get_task(task)
    plain = Simulator(task, task.sample("test", 200, 1), threads=1)
    moved = places_of_object(reset("object_off_0.01", task)) - places_of_object(plain)
    assert moved[:, :2].std(axis=0) == pytest.approx([0.01, 0.01], rel=0.15)
    assert abs(moved[:, 2]).max() < 1e-3  # Tool's frame is turned by 89.95 degrees


def places_of_object(simulator):
    """Where MuJoCo finds the object of each episode [m], (B, 3)."""
    model = simulator.task.model
    data = mujoco.MjData(model)
    found = []
    for qpos in simulator.batch.qpos:
        data.qpos = qpos
        mujoco.mj_kinematics(model, data)
        found.append(data.body("Object").xpos.copy())
    return np.array(found)


def test_a_push_comes_once_in_the_first_half():
    task = get_task("tool")
    simulator = Simulator(task, task.sample("test", 30, 1), threads=1)
    disturbed = Disturbed(Still(), find_disturbances("hand_push_4+object_push_0.4", task))
    disturbed.reset(simulator)
    pushed = np.zeros((task.steps, 30, simulator.batch.qvel.shape[1]), bool)
    for step in range(task.steps):
        before = simulator.batch.qvel.copy()
        disturbed.act(simulator, step)
        pushed[step] = simulator.batch.qvel != before
    hand, hammer = pushed[:, :, 5], pushed[:, :, task.model.joint("OBJTx").id]
    for when in (hand, hammer):
        assert (when.sum(axis=0) == 1).all()
        assert not when[task.steps // 2 :].any()
    assert (hand != hammer).any()
    pushed_at_all = {task.model.joint(int(i)).name for i in np.flatnonzero(pushed.any(axis=(0, 1)))}
    assert {name for name in pushed_at_all if name.startswith("OBJ")} == {"OBJTx", "OBJTz"}


def test_what_is_read_has_errors_and_the_simulation_has_none():
    plain, noisy = (drive(name, 3) for name in (UNDISTURBED, "noise_0.03"))
    np.testing.assert_array_equal(plain[0].batch.qpos, noisy[0].batch.qpos)
    width = RELOCATION.robot_dim
    for name in ("joints", "velocities", "observed"):
        errors = getattr(noisy[1], name) - getattr(plain[1], name)
        assert errors.std() == pytest.approx(0.03, rel=0.3)
    np.testing.assert_array_equal(noisy[1].states[-1][:, :width], noisy[1].joints)
    first, last = noisy[1].states[1], noisy[1].states[-1]
    assert not np.array_equal(first - plain[1].states[1], last - plain[1].states[-1])


@pytest.mark.parametrize("late", [1, 2])
def test_actions_arrive_late_and_servos_rest_until_then(late):
    policy, arrived = Still(), []
    simulator = Simulator(RELOCATION, RELOCATION.sample("test", 2, 1), threads=1)
    disturbed = Disturbed(policy, find_disturbances(f"late_{late}", RELOCATION))
    disturbed.reset(simulator)
    rest = simulator.set_points()
    for step in range(5):
        arrived.append(disturbed.act(simulator, step))
    for acted in arrived[:late]:
        np.testing.assert_array_equal(acted, rest)
    sent = [0.01 * command for command in policy.commands]
    np.testing.assert_array_equal(arrived[late:], sent[: 5 - late])
    simulator.step(rest)
    assert not simulator.batch.ctrl.any()


def test_episodes_do_not_depend_on_threads_or_grouping():
    name = "joints_off_0.05+hand_push_1+noise_0.01+late_1"
    found = find_disturbances(name, RELOCATION)
    expert, starts = load_expert(RELOCATION).policy, RELOCATION.sample("test", 6, 2)

    def run(part, threads):
        return rollout(
            RELOCATION, part, Disturbed(expert, found), steps=40, chunk=6, threads=threads
        )

    whole = run(starts, 2)
    parts = join_episodes([run(starts[:2], 1), run(starts[2:], 1)])
    np.testing.assert_array_equal(whole.readings, parts.readings)


def test_seeds_meet_other_disturbances():
    one, other = (
        drive("joints_off_0.05", 0, RELOCATION.sample("test", 3, seed))[0].batch.qpos
        for seed in (1, 2)
    )
    assert (one[:, 5] != other[:, 5]).all()


def test_every_task_names_the_disturbances_that_it_can_have():
    for name in TASKS:
        task = get_task(name)
        names = names_of(task)
        assert all(find_disturbances(one, task) for one in names)
        kinds = {one.rpartition("_")[0] for one in names}
        still = name in ("door", "relocation")
        assert set(KINDS) - kinds == ({"object_off", "object_push"} if still else set())


@pytest.mark.parametrize(
    ("name", "answer"),
    [
        ("joint_off_0.05", "did you mean 'joints_off'"),
        ("joints_off", r"joints_off needs a strength \[rad\], as in 'joints_off_0.02'"),
        ("late_1+noise", r"noise needs a strength \[own unit\], as in 'noise_0.01'"),
        ("late", "late needs a strength"),
        ("joints_off_-1", "must be a number above 0"),
        ("joints_off_nan", "must be a number above 0"),
        ("late_1.5", "must be a whole number above 0"),
        ("late_1+late_2", "names a kind twice"),
        ("joints_off_0.050", "is written 'joints_off_0.05'"),
        ("late_1+", "kind of disturbance"),
        ("late_1+joints_off_0.05", "is written 'joints_off_0.05\\+late_1'"),
        ("object_off_0.01", "is not free to move, or its state does not tell where it is"),
    ],
)
def test_names_that_mean_nothing_are_refused(name, answer):
    with pytest.raises(InputError, match=answer):
        find_disturbances(name, RELOCATION)


def test_each_recorded_state_has_errors_of_its_own():
    task = get_task("door")
    names, starts = (UNDISTURBED, "noise_0.03"), task.sample("demo", 2, 1)
    plain, noisy = (
        record(task, starts, Still(), threads=1, failures=True, disturbance=name)[1].states
        for name in names
    )
    errors = (noisy - plain)[0, :, 0]
    assert len({*errors.round(9)}) == len(errors) == task.horizon


def test_an_object_that_cannot_move_is_not_disturbed():
    with pytest.raises(InputError, match="the object of door is not free to move"):
        find_disturbances("object_off_0.01", get_task("door"))


def test_demonstrations_of_a_disturbed_expert_show_what_it_read_and_answered():
    task, expert = get_task("door"), load_expert(get_task("door")).policy
    demos = make_demos(task, expert, 5, seed=3, threads=1, disturbance="joints_off_0.05+late_1")
    plain = make_demos(task, expert, 5, seed=3, threads=1)
    off = demos.states[:, 0, : task.robot_dim] - plain.states[:, 0, : task.robot_dim]
    assert 0.02 < off.std() < 0.06
    simulator = Simulator(task, demos.starts, threads=1)
    Disturbed(expert, find_disturbances("joints_off_0.05", task)).reset(simulator)
    np.testing.assert_array_equal(simulator.state(), demos.states[:, 0])
    answered = np.clip(expert.act(simulator, 0), -1, 1)
    np.testing.assert_allclose(answered, demos.actions[:, 0], atol=1e-12)
