import numpy as np
import pytest

from reports.coverage import (
    contradicted,
    covered_by_bootstrap,
    covered_differences,
    covered_rates,
)
from reports.simulated import SCENARIOS, Scenario, repeated
from tasks.data import generator

BY_NAME = {scenario.name: scenario for scenario in SCENARIOS}
MIDDLE = BY_NAME["85 and 85"]


@pytest.mark.parametrize("name", ["40 and 40", "85 and 85", "97 and 90"])
@pytest.mark.parametrize("seeds", [3, 5, 10])
def test_intervals_of_differences_cover_the_truth_as_often_as_they_say(name, seeds):
    assert 0.92 <= covered_differences(BY_NAME[name], seeds, 200, 400) <= 0.99


def test_intervals_of_rates_cover_the_truth_as_often_as_they_say():
    assert 0.92 <= covered_rates(MIDDLE, 5, 200, 400) <= 0.985


def test_a_seed_that_varies_by_16_points_is_covered_where_the_plain_t_misses():
    wide = BY_NAME["85 and 85, one varies by 16"]
    rng = generator("plain t")
    missed = []
    for _ in range(400):
        left, right = repeated(wide, 5, 200, rng).mean(axis=2)
        gaps = left - right
        missed.append(abs(gaps.mean()) > 2.776 * gaps.std(ddof=1) / np.sqrt(5))
    assert np.mean(missed) > 0.08
    assert covered_differences(wide, 5, 200, 400) >= 0.92


def test_a_bootstrap_over_seeds_that_share_a_controller_misses_the_truth_over_controllers():
    assert covered_by_bootstrap(MIDDLE, 5, 200, 40) <= 0.85


def test_a_claim_whose_differences_are_all_zero_is_seldom_contradicted():
    assert contradicted(seeds=5, starts=200, studies=40) <= 0.05


def test_simulated_rates_have_the_mean_and_spread_of_their_scenario():
    rates = repeated(MIDDLE, 2000, 200, generator("scenario")).mean(axis=2)
    over_starts = 0.85 * 0.15 / 200
    spread = np.hypot(MIDDLE.controllers, MIDDLE.seeds)
    assert rates.mean(axis=1) == pytest.approx(MIDDLE.rates, abs=0.005)
    assert np.sqrt(rates.var(axis=1) - over_starts) == pytest.approx(spread, rel=0.1)


def test_a_scenario_at_100_never_fails():
    sure = Scenario("sure", (1.0, 0.5), (0.0, 0.0), (0.0, 0.0))
    assert repeated(sure, 3, 50, generator("sure"))[0].all()
