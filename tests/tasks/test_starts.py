import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tasks.base import IN_DISTRIBUTION, SPLITS
from tasks.data import Starts, generator
from tasks.errors import InputError
from tasks.registry import TASKS, get_task
from tasks.reorientation import goal_frame

tasks = st.sampled_from(TASKS).map(get_task)
counts = st.integers(0, 300)

# Bounds of each component in appendix D; out of distribution, those of the outer box.
RANGES = {
    "tool": ([(0.1, 0.25)], [(0.05, 0.3)]),
    "door": (
        [(-0.3, 0.0), (0.2, 0.35), (0.252, 0.402)],
        [(-0.3, 0.0), (0.15, 0.4), (0.252, 0.402)],
    ),
    "relocation": (
        [(-0.25, 0.25), (-0.25, 0.25), (0.15, 0.35)],
        [(-0.25, 0.25), (-0.25, 0.25), (0.35, 0.40)],
    ),
    "reorientation": ([(-1.0, 1.0)] * 2, [(-1.2, 1.2)] * 2),
}


def within(values, bounds):
    low, high = np.array(bounds).T
    return ((low <= values) & (values <= high)).all(axis=1)


@given(tasks, st.sampled_from(SPLITS), counts)
def test_every_start_is_in_the_range_of_its_split(task, split, n):
    starts = task.sample(split, n)
    inner, outer = RANGES[task.name]
    assert len(starts) == n
    assert starts.index.tolist() == list(range(n))
    assert within(starts.values, inner if split in IN_DISTRIBUTION else outer).all()
    task.check_starts(starts)


@given(tasks, counts)
def test_out_of_distribution_starts_are_outside_the_training_range(task, n):
    assert not within(task.sample("ood", n).values, RANGES[task.name][0]).any()


@given(tasks, st.sampled_from(SPLITS), counts, counts)
def test_a_start_does_not_depend_on_the_number_of_starts(task, split, n, m):
    few, many = sorted((n, m))
    np.testing.assert_array_equal(
        task.sample(split, few).values, task.sample(split, many)[:few].values
    )


def test_no_two_splits_share_a_stream():
    first_draws = [
        generator("starts", name, split).random(1000).tobytes()
        for name in TASKS
        for split in SPLITS
    ]
    in_distribution = [
        get_task(name).sample(split, 1000).values[:, 0] for name in TASKS for split in SPLITS
    ]
    assert len(set(first_draws)) == len(TASKS) * len(SPLITS)
    for position, values in enumerate(in_distribution):
        for others in in_distribution[position + 1 :]:
            assert not np.isin(values, others).any()


def test_boxes_out_of_distribution_are_drawn_equally_often(task):
    values = task.sample("ood", 20_000).values
    boxes = task.ranges("ood")
    shares = [box.contains(values).mean() for box in boxes]
    np.testing.assert_allclose(shares, 1 / len(boxes), atol=0.02)
    volumes = [np.prod(np.subtract(box.high, box.low)) for box in boxes]
    np.testing.assert_allclose(volumes, volumes[0])


angle = st.floats(-1.2, 1.2)


@given(angle, angle)
def test_the_goal_frame_is_a_rotation_that_maps_the_goal_to_the_x_axis(pitch, yaw):
    goal = np.array([np.sin(yaw), -np.sin(pitch) * np.cos(yaw), np.cos(pitch) * np.cos(yaw)])
    (frame,) = goal_frame(goal[None])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frame), 1, atol=1e-12)
    np.testing.assert_allclose(frame @ goal, [1, 0, 0], atol=1e-12)


def test_an_unknown_split_is_refused_with_the_nearest_name(task):
    with pytest.raises(InputError, match="train, demo, probe, test, ood; did you mean 'test'"):
        task.sample("tset", 3)


def test_a_negative_number_of_starts_is_refused(task):
    with pytest.raises(InputError, match="0 or more, got -1"):
        task.sample("test", -1)


def test_a_start_out_of_range_is_refused_with_the_allowed_range(task):
    starts = task.sample("test", 4)
    starts.values[2, 0] = 7.0
    name = task.start_components[0].name
    with pytest.raises(InputError, match=rf"start 2 of {task.name}/test .*7\.0.*{name} in \["):
        task.check_starts(starts)


def test_starts_of_another_task_or_width_are_refused(task):
    other = get_task(TASKS[TASKS.index(task.name) - 1])
    with pytest.raises(InputError, match=f"are for task '{other.name}', not '{task.name}'"):
        task.check_starts(other.sample("test", 1))
    with pytest.raises(InputError, match="got 9"):
        task.check_starts(Starts(task.name, "test", np.arange(2), np.zeros((2, 9))))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_starts_that_are_not_finite_are_refused(bad):
    with pytest.raises(InputError, match=r"start 5 of door/test .* must be finite"):
        Starts("door", "test", np.array([4, 5]), np.array([[0.0, 0, 0], [0, bad, 0]]))


@pytest.mark.parametrize(("index", "values"), [((2,), (3, 1)), ((2, 1), (2, 1)), ((2,), (2,))])
def test_starts_with_mismatched_shapes_are_refused(index, values):
    with pytest.raises(InputError, match="same length B"):
        Starts("tool", "test", np.zeros(index), np.zeros(values))


def test_a_random_stream_depends_on_its_parts_alone():
    np.random.default_rng(0)
    again = generator("a", 1).random(4)
    np.testing.assert_array_equal(generator("a", 1).random(4), again)
    for parts in (("a", "1"), ("a", 2), ("a1",), ("a", 1, "")):
        assert not np.array_equal(generator(*parts).random(4), again)
