from itertools import combinations_with_replacement

import numpy as np
import pytest

from methods.regression import Regression, RegressionConfig
from methods.toy import LAYOUT, toy
from tasks.data import generator
from tasks.errors import InputError


def fitted(demos, validation=None, **config) -> Regression:
    method = Regression(RegressionConfig(**config), LAYOUT)
    method.fit(demos, demos if validation is None else validation, 1)
    return method


def by_normal_equations(demos, starts, degree, ridge):
    """Returns motions by ridge regression, one output at a time, on monomials in plain loops."""
    varying = [i for i in range(demos.states.shape[2]) if np.ptp(demos.states[:, 0, i]) > 0]
    given = demos.states[:, 0, varying]

    def monomials(x):
        x = (x - given.mean(axis=0)) / given.std(axis=0)
        return np.array(
            [
                [
                    np.prod([row[i] for i in chosen])
                    for d in range(1, degree + 1)
                    for chosen in combinations_with_replacement(range(len(varying)), d)
                ]
                for row in x
            ]
        )

    inputs = monomials(given)
    mean, scale = inputs.mean(axis=0), inputs.std(axis=0)
    inputs, asked = (inputs - mean) / scale, (monomials(starts[:, varying]) - mean) / scale
    gram = inputs.T @ inputs + ridge * len(demos) * np.eye(inputs.shape[1])
    motion = np.repeat(starts[:, None], demos.states.shape[1], axis=1)
    for t in range(1, demos.states.shape[1]):
        for d in range(demos.states.shape[2]):
            wanted = demos.states[:, t, d]
            found = np.linalg.solve(gram, inputs.T @ (wanted - wanted.mean()))
            motion[:, t, d] = wanted.mean() + asked @ found
    return motion


@pytest.mark.parametrize("ridge", [1e-3, 1.0])
def test_motions_are_those_of_the_normal_equations(ridge):
    demos, starts = toy(0, 40), toy(50, 5).states[:, 0]
    method = fitted(demos, degree=1, ridge=ridge)
    expected = by_normal_equations(demos, starts, 1, ridge)
    np.testing.assert_allclose(method.rollout(starts, 99), expected, atol=1e-9)


def test_motions_of_higher_degree_are_those_of_the_normal_equations():
    demos, starts = squared(toy(0, 60), 2), squared(toy(70, 5), 2).states[:, 0]
    method = fitted(demos, squared(toy(60, 10), 2), degree=2, ridge=1e-2)
    assert method.parameters()["degree"] == 2
    expected = by_normal_equations(demos, starts, 2, 1e-2)
    np.testing.assert_allclose(method.rollout(starts, 99), expected, atol=1e-9)


def squared(demos, degree):
    """The demonstrations with a last joint that follows a power of the object's first place."""
    place = demos.states[:, :1, LAYOUT.robot_dim]
    demos.states[:, 1:, LAYOUT.robot_dim - 1] = (3 * place) ** degree
    return demos


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_the_degree_with_the_lowest_validation_error_is_kept(degree):
    demos, unseen = squared(toy(0, 150), degree), squared(toy(150, 30), degree)
    method = fitted(demos, unseen, degree=3, ridge=1e-6)
    assert method.parameters()["degree"] == degree


def test_components_that_never_vary_are_no_inputs():
    method = fitted(toy(0, 30))
    # The hand always starts in one posture.
    np.testing.assert_array_equal(
        method.parameters()["varying"], LAYOUT.robot_dim + np.arange(LAYOUT.object_dim)
    )


def test_demonstrations_from_a_single_start_give_their_mean():
    demos = toy(0, 4)
    demos.states[:, 0] = demos.states[0, 0]
    found = fitted(demos).rollout(demos.states[:1, 0], 99)
    np.testing.assert_allclose(found[0], demos.states.mean(axis=0), atol=1e-12)


def test_more_monomials_than_demonstrations_are_no_difficulty():
    demos = toy(0, 8)
    demos.states[:, 0] += 0.01 * generator("posture").standard_normal(demos.states[:, 0].shape)
    found = fitted(demos).rollout(demos.states[:, 0], 99)
    assert np.isfinite(found).all()
    assert np.abs(found - demos.states).max() < 0.05


@pytest.mark.parametrize("config", [{"degree": 0}, {"degree": 4}, {"ridge": 0.0}])
def test_settings_out_of_range_are_refused(config):
    with pytest.raises(InputError, match=next(iter(config))):
        RegressionConfig(**config)
