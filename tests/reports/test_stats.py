import numpy as np
import pytest
from scipy.stats import norm
from statsmodels.stats.proportion import proportion_confint

from bench.intervals import wilson
from reports.stats import bootstrap, rate_interval
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
    rng = generator("seeds and episodes")
    alike, apart = (
        np.stack([rng.permutation(100) < count for count in counts])
        for counts in ([50] * 5, [10, 30, 50, 70, 90])
    )
    narrow = bootstrap(alike, "alike")
    # 500 episodes at one half have a standard error of 2.2 points. Seeds that differ by chance
    # alone cannot be told from others, so that chance counts up to three times in the variance.
    widened = np.diff(narrow)[0] / (2 * 1.96 * np.sqrt(0.25 / 500))
    assert 1 < widened < np.sqrt(3)
    assert np.diff(bootstrap(apart, "apart"))[0] > 3.5 * np.diff(narrow)[0]
    assert bootstrap(alike, "alike") == narrow


def test_seeds_that_fail_on_the_same_starts_tell_no_more_than_one():
    one = generator("same starts").random(400) < 0.7
    five = bootstrap(np.tile(one, (5, 1)), "five")
    assert np.diff(five)[0] == pytest.approx(2 * 1.96 * np.sqrt(0.7 * 0.3 / 400), rel=0.1)


def test_the_bootstrap_of_five_seeds_covers_less_than_it_says_as_captions_tell():
    rng = generator("bootstrap coverage")
    covered = []
    for trial in range(150):
        rates = rng.beta(16, 4, (5, 1))
        low, high = bootstrap(rng.random((5, 200)) < rates, trial)
        covered.append(low <= 0.8 <= high)
    assert 0.8 <= np.mean(covered) <= 0.92


def test_the_bootstrap_covers_as_much_where_starts_are_hard_for_all_seeds():
    """Each seed misses what is harder than its own skill, but for some luck."""
    rng = generator("coverage on shared starts")
    covered = []
    for trial in range(150):
        skill, luck = 1 + 0.3 * rng.standard_normal((5, 1)), rng.standard_normal((5, 200))
        outcomes = np.sqrt(0.8) * rng.standard_normal(200) + np.sqrt(0.2) * luck < skill
        low, high = bootstrap(outcomes, trial)
        covered.append(low <= norm.cdf(1 / np.sqrt(1 + 0.3**2)) <= high)
    assert 0.85 <= np.mean(covered) <= 0.96


def test_a_single_fit_has_wilsons_interval():
    assert rate_interval(np.arange(20)[None] < 7, "x") == wilson(7, 20)
