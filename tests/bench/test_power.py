import numpy as np
import pytest
from scipy.stats import ttest_1samp
from statsmodels.stats.power import TTestPower

from bench.power import detectable_difference, power, seeds_needed
from tasks.data import generator
from tasks.errors import InputError


@pytest.mark.parametrize("seeds", [3, 5, 10, 30])
@pytest.mark.parametrize("deviation", [2.0, 5.0])
def test_the_detectable_difference_is_that_of_statsmodels(seeds, deviation):
    size = TTestPower().solve_power(nobs=seeds, alpha=0.05, power=0.8)
    assert detectable_difference(deviation, seeds) == pytest.approx(size * deviation, rel=1e-5)


def test_so_many_of_simulated_studies_find_the_detectable_difference():
    differences = generator("power").normal(detectable_difference(5, 5), 5, (4000, 5))
    found = np.mean(ttest_1samp(differences, 0, axis=1).pvalue <= 0.05)
    assert found == pytest.approx(0.8, abs=0.02)


@pytest.mark.parametrize("difference", [3, 5, 10])
def test_one_seed_fewer_than_needed_is_too_few(difference):
    seeds = seeds_needed(difference, 5)
    assert power(difference, 5, seeds) >= 0.8 > power(difference, 5, seeds - 1)


def test_two_seeds_are_the_fewest():
    assert seeds_needed(50, 0.1) == 2


@pytest.mark.parametrize(
    "call",
    [
        lambda: power(3, 5, 1),
        lambda: detectable_difference(0, 5),
        lambda: seeds_needed(0, 5),
        lambda: seeds_needed(3, -1),
    ],
)
def test_studies_without_power_are_refused(call):
    with pytest.raises(InputError):
        call()
