import numpy as np
import pytest
from statsmodels.stats.proportion import proportion_confint

from reports.stats import bootstrap, rate_interval, wilson
from tasks.data import generator


@pytest.mark.parametrize(
    ("successes", "n"), [(0, 20), (1, 50), (37, 50), (200, 200), (9731, 10_000)]
)
def test_wilson_is_that_of_statsmodels(successes, n):
    np.testing.assert_allclose(
        wilson(successes, n), proportion_confint(successes, n, method="wilson"), atol=1e-12
    )


def test_wilson_covers_the_truth_as_often_as_it_says():
    rng = generator("wilson coverage")
    covered = []
    for rate in (0.1, 0.5, 0.9):
        for successes in rng.binomial(200, rate, 400):
            low, high = wilson(int(successes), 200)
            covered.append(low <= rate <= high)
    assert 0.94 <= np.mean(covered) <= 0.97


def test_the_bootstrap_sees_both_seeds_and_episodes():
    episodes = np.full(5, 100)
    alike = bootstrap(np.full(5, 50), episodes, "alike")
    apart = bootstrap(np.array([10, 30, 50, 70, 90]), episodes, "apart")
    # 500 episodes at one half: a standard error of 2.2 points.
    assert np.diff(alike)[0] == pytest.approx(2 * 1.96 * np.sqrt(0.25 / 500), rel=0.1)
    assert np.diff(apart)[0] > 4 * np.diff(alike)[0]
    assert bootstrap(np.full(5, 50), episodes, "alike") == alike


def test_the_bootstrap_of_five_seeds_covers_less_than_it_says_as_captions_tell():
    rng = generator("bootstrap coverage")
    covered = []
    for trial in range(150):
        rates = rng.beta(16, 4, 5)
        low, high = bootstrap(rng.binomial(200, rates), np.full(5, 200), trial)
        covered.append(low <= 0.8 <= high)
    assert 0.8 <= np.mean(covered) <= 0.92


def test_a_single_fit_has_wilsons_interval():
    assert rate_interval(np.array([7]), np.array([20]), "x") == wilson(7, 20)
