import numpy as np
import pytest
from scipy.stats import binomtest
from statsmodels.stats.contingency_tables import mcnemar as of_statsmodels
from statsmodels.stats.proportion import proportion_confint

from bench.intervals import mcnemar, wilson
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


def test_mcnemar_equals_statsmodels():
    rng = generator("mcnemar")
    left, right = rng.random(80) < 0.8, rng.random(80) < 0.6
    table = [[(left & right).sum(), (left & ~right).sum()], [(~left & right).sum(), 0]]
    assert mcnemar(left, right) == pytest.approx(of_statsmodels(table, exact=True).pvalue)
    assert mcnemar(left, left) == 1.0


def test_mcnemar_counts_only_the_starts_from_which_one_alone_succeeds():
    left, right = np.arange(100) < 60, np.arange(100) < 52
    assert mcnemar(left, right) == pytest.approx(binomtest(8, 8).pvalue)
    again = [np.concatenate([one, np.ones(500, bool)]) for one in (left, right)]
    assert mcnemar(*again) == mcnemar(left, right)
