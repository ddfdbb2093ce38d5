import numpy as np
import pytest

from methods.nearest import Nearest, NearestConfig
from methods.toy import LAYOUT, toy


def fitted(demos) -> Nearest:
    method = Nearest(NearestConfig(), LAYOUT)
    method.fit(demos, demos, 1)
    return method


@pytest.fixture
def nearest():
    return fitted(toy(0, 12))


def test_from_its_own_start_a_demonstration_is_replayed(nearest):
    demos = toy(0, 12)
    np.testing.assert_array_equal(nearest.rollout(demos.states[:, 0], 99), demos.states)


def test_from_its_own_states_the_rest_of_a_demonstration_is_replayed(nearest):
    demos = toy(0, 12).states
    for t in (7, 60):
        np.testing.assert_array_equal(nearest.rollout(demos[:, t], 99 - t), demos[:, t:])


def test_the_nearest_state_is_found_as_a_loop_finds_it(nearest):
    demos, starts = toy(0, 12).states, toy(3, 20).states[:, 30]
    scale = np.maximum(demos.std(axis=(0, 1)), 1e-2)
    for start, motion in zip(starts, nearest.rollout(starts, 20), strict=True):
        apart = np.linalg.norm((start - demos) / scale, axis=-1)
        which, when = np.unravel_index(apart.argmin(), apart.shape)
        np.testing.assert_array_equal(motion[0], start)
        np.testing.assert_array_equal(motion[1:], demos[which, when + 1 : when + 21])


def test_components_of_the_state_count_by_their_spread():
    demos = toy(0, 3)
    demos.states[:] = 0
    demos.states[:, :, -2:] = np.array([[0, 0], [100, 1], [0, 2]])[:, None]
    start = np.zeros((1, LAYOUT.state_dim))
    start[:, -2:] = 30, 2  # nearer to the first by plain distance
    found = fitted(demos).rollout(start, 9)[0, 1:]
    np.testing.assert_array_equal(found, demos.states[2, 1:10])


def test_a_motion_that_goes_on_longer_rests_at_its_end(nearest):
    demos = toy(0, 12).states
    longer = nearest.rollout(demos[:2, 0], 120)
    assert longer.shape[1] == 121
    np.testing.assert_array_equal(longer[:, 100:], np.repeat(demos[:2, -1:], 21, axis=1))
