import numpy as np
import pytest

from methods.nearest import Nearest, NearestConfig
from methods.toy import LAYOUT, toy


@pytest.fixture
def nearest():
    method = Nearest(NearestConfig(), LAYOUT)
    method.fit(toy(0, 12), toy(0, 1), 1)
    return method


def test_from_its_own_start_a_demonstration_is_replayed(nearest):
    demos = toy(0, 12)
    np.testing.assert_array_equal(nearest.rollout(demos.states[:, 0], 99), demos.states)


def test_the_nearest_start_is_found_as_a_loop_finds_it(nearest):
    demos, starts = toy(0, 12).states, toy(3, 20).states[:, 0]
    scale = np.maximum(demos[:, 0].std(axis=0), 1e-2)
    for start, motion in zip(starts, nearest.rollout(starts, 99), strict=True):
        apart = [np.linalg.norm((start - one[0]) / scale) for one in demos]
        np.testing.assert_array_equal(motion[1:], demos[int(np.argmin(apart)), 1:])
        np.testing.assert_array_equal(motion[0], start)


def test_components_of_the_start_count_by_their_spread():
    demos = toy(0, 3)
    demos.states[:, 0] = 0
    demos.states[:, 0, -2:] = [[0, 0], [100, 1], [0, 2]]
    method = Nearest(NearestConfig(), LAYOUT)
    method.fit(demos, demos, 1)
    start = np.zeros((1, LAYOUT.state_dim))
    start[:, -2:] = 30, 2  # nearer to the first by plain distance
    np.testing.assert_array_equal(method.rollout(start, 99)[0, 1:], demos.states[2, 1:])


def test_a_shorter_motion_is_cut_and_a_longer_one_rests_at_its_end(nearest):
    demos = toy(0, 12).states
    np.testing.assert_array_equal(nearest.rollout(demos[:2, 0], 5), demos[:2, :6])
    longer = nearest.rollout(demos[:2, 0], 120)
    assert longer.shape[1] == 121
    np.testing.assert_array_equal(longer[:, 100:], np.repeat(demos[:2, -1:], 21, axis=1))
