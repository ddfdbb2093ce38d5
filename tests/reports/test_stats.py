import numpy as np
import pytest
from scipy.stats import norm
from statsmodels.stats.proportion import proportion_confint

from bench.intervals import wilson
from reports.stats import (
    bootstrap,
    mcnemar,
    mean_over_tasks,
    paired_difference,
    rate_interval,
)
from tasks.data import generator


@pytest.mark.parametrize(
    ("successes", "n"), [(0, 20), (1, 50), (37, 50), (200, 200), (9731, 10_000)]
)
def test_wilson_equals_statsmodels(successes, n):
    np.testing.assert_allclose(
        wilson(successes, n), proportion_confint(successes, n, method="wilson"), atol=1e-12
    )


def test_wilson_covers_the_truth_95_times_in_100():
    rng = generator("wilson coverage")
    covered = []
    for rate in (0.1, 0.5, 0.9):
        for successes in rng.binomial(200, rate, 400):
            low, high = wilson(int(successes), 200)
            covered.append(low <= rate <= high)
    assert 0.94 <= np.mean(covered) <= 0.97


def test_bootstrap_widens_with_the_spread_of_seeds():
    rng = generator("seeds and episodes")
    alike, apart = (
        np.stack([rng.permutation(100) < count for count in counts])
        for counts in ([50] * 5, [10, 30, 50, 70, 90])
    )
    narrow = bootstrap(alike, "alike")
    # 500 episodes at one half have a standard error of 2.2 points. Seeds that differ by chance
    # alone look like seeds that truly differ, so chance counts up to three times in the variance.
    widened = np.diff(narrow)[0] / (2 * 1.96 * np.sqrt(0.25 / 500))
    assert 1 < widened < np.sqrt(3)
    assert np.diff(bootstrap(apart, "apart"))[0] > 3.5 * np.diff(narrow)[0]
    assert bootstrap(alike, "alike") == narrow


def test_identical_seeds_give_the_interval_of_one_seed():
    one = generator("same starts").random(400) < 0.7
    five = bootstrap(np.tile(one, (5, 1)), "five")
    assert np.diff(five)[0] == pytest.approx(2 * 1.96 * np.sqrt(0.7 * 0.3 / 400), rel=0.1)


def test_bootstrap_of_five_seeds_covers_less_than_95_in_100_as_captions_say():
    rng = generator("bootstrap coverage")
    covered = []
    for trial in range(150):
        rates = rng.beta(16, 4, (5, 1))
        low, high = bootstrap(rng.random((5, 200)) < rates, trial)
        covered.append(low <= 0.8 <= high)
    assert 0.8 <= np.mean(covered) <= 0.92


def test_bootstrap_covers_as_much_if_starts_are_hard_for_all_seeds():
    """A seed fails on starts that are harder than its skill, apart from luck."""
    rng = generator("coverage on shared starts")
    covered = []
    for trial in range(150):
        skill, luck = 1 + 0.3 * rng.standard_normal((5, 1)), rng.standard_normal((5, 200))
        outcomes = np.sqrt(0.8) * rng.standard_normal(200) + np.sqrt(0.2) * luck < skill
        low, high = bootstrap(outcomes, trial)
        covered.append(low <= norm.cdf(1 / np.sqrt(1 + 0.3**2)) <= high)
    assert 0.85 <= np.mean(covered) <= 0.96


def test_single_fit_has_wilsons_interval():
    assert rate_interval(np.arange(20)[None] < 7, "x") == wilson(7, 20)


def test_pairing_starts_narrows_the_interval_of_a_difference():
    rng = generator("pairing")
    hard = rng.random(500)
    left = (hard + 0.02 * rng.standard_normal((5, 500))) < 0.7
    right = (hard + 0.02 * rng.standard_normal((5, 500))) < 0.6
    paired = paired_difference(left, right, "paired")
    apart = paired_difference(left, right[:, rng.permutation(500)], "apart")
    assert paired[0] == pytest.approx(apart[0]) == pytest.approx(left.mean() - right.mean())
    assert paired[2] - paired[1] < 0.7 * (apart[2] - apart[1])
    assert paired[1] <= paired[0] <= paired[2]


def test_interval_of_a_difference_equals_that_of_a_naive_bootstrap():
    rng = generator("one by one")
    left, right = rng.random((3, 60)) < 0.9, rng.random((4, 60)) < 0.7
    drawn = []
    for _ in range(4000):
        starts = rng.integers(60, size=60)
        ours, theirs = (
            np.mean([part[rng.integers(len(part)), starts].mean() for _ in part])
            for part in (left, right)
        )
        drawn.append(ours - theirs)
    _, low, high, _ = paired_difference(left, right, "by kinds", resamples=4000)
    assert [low, high] == pytest.approx(np.quantile(drawn, [0.025, 0.975]), abs=0.015)


def test_interval_of_a_single_fit_has_the_standard_error_of_its_starts():
    left = generator("single").random((1, 2000)) < 0.8
    difference, low, high, _ = paired_difference(left, np.zeros((1, 2000), bool), "single")
    error = np.sqrt(left.var() / 2000)
    assert (high - low) / 2 == pytest.approx(1.96 * error, rel=0.1)
    assert difference == left.mean()


def test_mcnemar_equals_statsmodels():
    from statsmodels.stats.contingency_tables import mcnemar as of_statsmodels

    rng = generator("mcnemar")
    left, right = rng.random(80) < 0.8, rng.random(80) < 0.6
    table = [[(left & right).sum(), (left & ~right).sum()], [(~left & right).sum(), 0]]
    assert mcnemar(left, right) == pytest.approx(of_statsmodels(table, exact=True).pvalue)
    assert mcnemar(left, left) == 1.0


def test_interquartile_mean_drops_the_best_and_worst_quarter():
    outcomes = [np.tile(np.arange(100) < 10 * rate, (1, 1)) for rate in (0, 2, 4, 10)]
    value, low, high = mean_over_tasks(outcomes, 0.25, "tasks")
    assert value == pytest.approx(0.3)
    # Two rates of 100 episodes each count: their mean's standard error is 0.032.
    assert high - low == pytest.approx(2 * 1.96 * 0.032, rel=0.1)


def test_interval_of_the_interquartile_mean_covers_the_true_value():
    rng = generator("coverage of the interquartile mean")
    rates, covered = np.array([0.2, 0.5, 0.6, 0.9]), 0
    for study in range(200):
        outcomes = [rng.random((1, 100)) < rate for rate in rates]
        _, low, high = mean_over_tasks(outcomes, 0.25, study, resamples=400)
        covered += low <= 0.55 <= high
    assert covered >= 180
