import numpy as np
import pandas as pd
import pytest

from reports.components import components, deviation
from reports.coverage import (
    contradicted,
    covered_differences,
    covered_rates,
)
from reports.simulated import BY_NAME, Scenario, repeated
from tasks.data import generator

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


def test_the_deviation_of_levels_leaves_out_the_luck_of_starts():
    rng = generator("levels")
    skill = 0.7 + 0.1 * rng.standard_normal((300, 1))
    assert deviation((rng.random((300, 100)) < skill).astype(float)) == pytest.approx(0.1, abs=0.02)
    assert deviation((rng.random((300, 100)) < 0.7).astype(float)) == pytest.approx(0, abs=0.01)


def stored(outcomes, method, controller, seeds):
    """Episodes as `bench.load` gives them, of outcomes (S, N)."""
    found = pd.DataFrame(outcomes).stack().rename("success").reset_index()
    names = {"task": "door", "method": method, "size": "small", "controller": controller}
    labels = {"split": "test", "physics": "nominal", "variant": "described", "rule": "appendix"}
    return found.assign(seed=np.take(seeds, found.level_0), start=found.level_1, demos=200).assign(
        **names, **labels
    )


def test_components_are_read_from_stored_episodes():
    """Each of five controllers moves NN, and nothing moves KODex; NN's seeds differ too."""
    rng = generator("stored")
    rates = [0.6, 0.7, 0.8, 0.9, 0.75]
    controllers = ["original", *(f"original-{n}" for n in range(2, 6))]
    by_seed = np.array([-0.05, 0, 0.05])[:, None]
    parts = []
    for controller, middle in zip(controllers, rates, strict=True):
        parts.append(stored(rng.random((3, 2000)) < middle + by_seed, "nn", controller, [1, 2, 3]))
        parts.append(stored(rng.random((1, 4000)) < 0.8, "kodex", controller, [0]))
    (row,) = components(pd.concat(parts)).to_dict("records")
    assert (row["task"], row["left"], row["right"]) == ("door", "kodex", "nn")
    assert row["controller"] == pytest.approx(100 * np.std(rates, ddof=1), abs=1.5)
    assert row["seed"] == pytest.approx(5, abs=1.5)
    assert row["start"] == pytest.approx(0, abs=0.05)
