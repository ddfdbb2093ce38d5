"""What `bench plan` says about the differences that a study can show."""

import json
from dataclasses import asdict, replace
from itertools import product

import numpy as np
import pandas as pd
import pytest
from resealed import pack_evaluations
from statsmodels.stats.power import TTestPower

from bench.detectable import power_given, power_of, told
from bench.names import PLAIN
from bench.presets import get_preset
from bench.spread import spread_over_seeds
from methods.registry import get_method
from tasks.data import generator
from tasks.registry import TASKS

STUDY = replace(get_preset("paper"), tasks=("door", "tool"))
METHODS = ("kodex", "nn", "ndp")


def row(task, method, seed, successes, **changes):
    """An evaluation as `bench.source.Source.frame` has it, of 1,000 episodes."""
    return {
        "task": task,
        "method": method,
        "variant": "described",
        "size": get_method(method).default_size[task],
        "config": "{}",
        "demos": 200,
        "held_out": 0,
        "seed": seed,
        "demos_key": "key",
        "settings": "",
        "expert": "first",
        "weights": "",
        "split": "test",
        "controller": "original",
        **PLAIN,
        "controller_key": f"{task} {seed}",
        "episodes": 1000,
        "successes": successes,
    } | changes


def packed(folder, rows):
    folder.mkdir()
    pack_evaluations(folder, pd.DataFrame(rows))
    return folder


@pytest.fixture
def ship(monkeypatch, tmp_path):
    """Ships packed results of some rows."""

    def put(rows):
        monkeypatch.setattr("bench.detectable.SHIPPED", packed(tmp_path / "small", rows))

    return put


def known_rates(seeds=5, **changes):
    """Rows in which KODex - NDP varies by 5 points on door, and all else by what is computed."""
    rng = generator("known rates")
    rates = {
        (task, method): rng.integers(600, 900, seeds) for task, method in product(TASKS, METHODS)
    }
    gaps = np.arange(seeds) - (seeds - 1) / 2
    rates["door", "kodex"] = rates["door", "ndp"] + np.round(50 * gaps / gaps.std(ddof=1))
    rows = [
        row(task, method, seed, int(rates[task, method][seed - 1]), **changes)
        for (task, method), seed in product(rates, range(1, seeds + 1))
        if (task, method) != ("tool", "nn")
    ]
    return rows, rates


def test_the_spread_is_the_standard_deviation_over_seeds_of_each_pairs_difference(ship):
    rows, rates = known_rates()
    spread = spread_over_seeds(pd.DataFrame(rows), STUDY.tasks)
    pairs = [("kodex", "ndp"), ("kodex", "nn"), ("ndp", "nn")]
    wanted = [(rates["door", one] - rates["door", other]).std(ddof=1) / 10 for one, other in pairs]
    assert wanted[0] == pytest.approx(5, abs=0.05)
    assert sorted(spread.deviations["door"]) == pytest.approx(sorted(wanted))
    assert len(spread.deviations["tool"]) == 1
    assert (spread.seeds, spread.episodes, spread.one_controller) == ((5, 5), 1000, False)
    assert spread.methods == METHODS
    ship(rows)
    power = power_of(STUDY)
    assert power.tasks["door"].deviation == pytest.approx(np.sqrt(np.mean(np.square(wanted))))
    assert power.lower_bound == ()


def test_the_smallest_difference_and_the_seeds_it_takes_are_those_of_statsmodels(ship):
    ship(known_rates()[0])
    power = power_of(replace(STUDY, seeds=(1, 2, 3, 4)))
    oracle = TTestPower()
    for one in (power.overall, *power.tasks.values()):
        size = oracle.solve_power(nobs=4, alpha=0.05, power=0.8)
        assert one.difference == pytest.approx(size * one.deviation, rel=1e-5)
        for points, seeds in one.seeds_needed.items():
            found = [oracle.power(points / one.deviation, n, 0.05) for n in (seeds - 1, seeds)]
            assert found[0] < 0.8 <= found[1]


def test_a_plan_does_not_promise_to_show_more_than_all_points(ship):
    ship(known_rates()[0])
    power = power_of(replace(STUDY, seeds=(1, 2)))
    vague = replace(power.overall, difference=120.0)
    assert "2 seeds show is more than 100 points (" in told(replace(power, overall=vague))[0]


@pytest.mark.parametrize(
    "changes",
    [
        {"split": "ood"},
        {"physics": "heavy_hand"},
        {"rule": "published"},
        {"disturbance": "late_1"},
        {"replan": 5},
        {"variant": "published"},
        {"controller": "unclipped"},
        {"settings": "cutoff=2"},
        {"held_out": 40},
        {"weights": "3f2a91c0"},
        {"size": "median"},
        {"method": "bc"},
    ],
)
def test_other_evaluations_do_not_count(changes):
    plain, _ = known_rates()
    others = [one | changes | {"successes": 0} for one in plain if one["method"] != "kodex"]
    found = spread_over_seeds(pd.DataFrame([*plain, *others]), STUDY.tasks)
    assert found == spread_over_seeds(pd.DataFrame(plain), STUDY.tasks)
    fewer = [one | {"demos": 10, "successes": 0} for one in plain]
    assert spread_over_seeds(pd.DataFrame([*plain, *fewer]), STUDY.tasks) == found


def test_the_size_that_does_best_on_validation_starts_counts():
    rows, _ = known_rates()
    small = [one | {"size": "small"} for one in rows if one["method"] == "ndp"]
    best = [
        one | {"split": "validation", "successes": 1000 * (one["size"] == "small")}
        for one in [*rows, *small]
    ]
    moved = [one | {"successes": 7 * one["seed"]} for one in small]
    found = spread_over_seeds(pd.DataFrame([*rows, *moved, *best]), ["door"])
    plain = spread_over_seeds(pd.DataFrame(rows), ["door"])
    assert found != plain
    assert spread_over_seeds(pd.DataFrame([*rows, *best]), ["door"]) == plain  # none is small


def test_too_few_common_seeds_are_said_to_be_not_known(ship):
    rows, _ = known_rates()
    ship([one for one in rows if one["seed"] < 3 or one["method"] == "kodex"])
    assert power_of(STUDY) is None
    (said,) = told(None)
    assert "is not known: in the shipped results of these tasks no two methods share 3 se" in said


def test_without_shipped_results_nothing_is_known(monkeypatch, tmp_path):
    monkeypatch.setattr("bench.detectable.SHIPPED", tmp_path)
    assert power_of(STUDY) is None


def test_seeds_that_share_one_controller_give_a_lower_bound(ship):
    ship(known_rates(controller_key="of all seeds")[0])
    power = power_of(STUDY)
    assert power.lower_bound == ("all seeds there share one controller",)
    first, second, third = told(power)
    least = f"{power.overall.difference:.1f}"
    assert f"methods that 10 seeds show is at least {least} points" in first
    assert second.startswith("seeds to tell two methods apart: at least ")
    assert third.startswith("estimated from 5 seeds of the shipped results of kodex, nn, ndp on")
    assert third.endswith("a lower bound, since all seeds there share one controller")


def test_a_study_of_fewer_episodes_than_the_shipped_results_gives_a_lower_bound(ship):
    ship(known_rates()[0])
    assert "about" in told(power_of(STUDY))[0]
    (reason,) = power_of(replace(STUDY, episodes={"success": 200})).lower_bound
    assert reason == "a seed has 1,000 episodes there, more than here"


def test_one_seed_shows_no_difference(ship):
    ship(known_rates()[0])
    power = power_of(replace(STUDY, seeds=(1,)))
    assert (power.overall.difference, power.tasks["door"].difference) == (None, None)
    assert told(power)[0] == "one seed cannot show that two methods differ"


def test_seeds_that_do_not_differ_tell_nothing():
    rows = [row("door", name, seed, 1000) for name in METHODS for seed in range(5)]
    spread = spread_over_seeds(pd.DataFrame(rows), ["door"])
    assert set(spread.deviations["door"]) == {0.0}
    assert power_given(STUDY, spread) is None


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_plan_shows_what_the_seeds_can_show(task, smoke, ship, bench, tmp_path):
    ship(known_rates()[0])
    options = ("plan", "smoke", "--seeds", "4", "--out", str(tmp_path / "out"))
    power = power_of(replace(get_preset("smoke"), seeds=(1, 2, 3, 4)))
    made = json.loads(bench(*options, "--json")[1])
    assert made["power"] == json.loads(json.dumps(asdict(power)))
    assert bench(*options)[1].splitlines()[-3:] == told(power)
