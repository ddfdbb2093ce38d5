"""Costs of jobs: the table, the calibration, and measured methods of packages."""

import json
import time
from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import pytest

from bench import machine, measuring, plan
from bench.agenda import make_agenda
from bench.computing import fit_methods
from bench.costs import Price, calibration_seconds, fit_cost
from bench.jobs import jobs_of
from bench.missing import find_missing
from bench.presets import get_preset
from bench.results import Results
from bench.spec import Fit
from bench.study_demos import demos_keys_of
from methods import registry
from methods.base import MotionMethod
from methods.kodex import Kodex
from methods.nn import NN


@dataclass(frozen=True)
class OwnConfig:
    epochs: int = 10


class Own(MotionMethod):
    """A method of another package."""

    summary = "does nothing"
    sizes: ClassVar = {"one": OwnConfig()}
    default_size: ClassVar = {}

    def fit(self, demos, validation, seed):
        pass

    def parameters(self):
        return {}

    def load(self, parameters):
        pass

    def rollout(self, start, steps):
        raise NotImplementedError


class Raises(Own):
    name = "raises"

    def fit(self, demos, validation, seed):
        raise ZeroDivisionError("no such luck\nat all")


class Choosy(Own):
    name = "choosy"

    def fit(self, demos, validation, seed):
        assert len(demos) >= 3
        assert len(validation) >= 3


class Nonsense(Own):
    name = "nonsense"

    @classmethod
    def fit_seeds(cls, config, layout, demos, validation, seeds):
        return "nothing"

    def parameters(self):
        return ["nothing"]


METHODS = {method.name: method for method in (Raises, Choosy, Nonsense, Kodex, NN)}


@pytest.fixture
def brought(monkeypatch):
    """KODex, NN and methods of other packages, which run in this process."""
    monkeypatch.setattr(registry, "SUITE", tuple(METHODS))
    monkeypatch.setattr(plan, "apart", lambda job, *arguments: job(*arguments))
    monkeypatch.setattr("bench.checking.SUITE", tuple(METHODS))
    monkeypatch.setattr("bench.checking.get_method", METHODS.get)
    monkeypatch.setattr(registry, "get_method", lambda name, variant="described": METHODS[name])
    monkeypatch.setattr(registry, "method_names", lambda: list(METHODS))
    plan._unit_seconds.cache_clear()
    yield
    plan._unit_seconds.cache_clear()


def block(method, seeds=1):
    sizes = METHODS[method].sizes
    size, config = next(iter(sizes.items()))
    return [
        Fit("door", method, "described", size, asdict(config), 10, seed, "key")
        for seed in range(1, seeds + 1)
    ]


def sharing(function, share=3):
    """Makes a function take as long as on a core that it shares with other processes."""

    def shared(*arguments, **options):
        began = time.perf_counter()
        result = function(*arguments, **options)
        time.sleep(share * (time.perf_counter() - began))
        return result

    return shared


def price_of_an_episode():
    return measuring._episode_seconds("door")


def price_of_a_fit():
    plan._unit_seconds.cache_clear()
    return plan._measured("door", "kodex", "described", "single", 1)


def time_of_a_fit():
    return fit_methods(block("kodex"), *machine.random_demos("door"))[0].seconds


@pytest.mark.parametrize("task", ["door"], indirect=True)
@pytest.mark.parametrize(
    ("price", "place", "name"),
    [
        (price_of_an_episode, measuring, "rollout"),
        (price_of_a_fit, Kodex, "fit"),
        (time_of_a_fit, Kodex, "fit"),
    ],
)
def test_a_busy_machine_does_not_raise_measured_costs(
    price, place, name, task, shipped, monkeypatch
):
    price()
    alone = min(price() for _ in range(3))
    monkeypatch.setattr(place, name, sharing(getattr(place, name)))
    assert min(price() for _ in range(3)) < 2 * alone


def test_a_method_that_fails_in_the_calibration_costs_the_mean_of_the_others(brought, capsys):
    blocks = [block("kodex"), block("raises"), block("nn", 2), block("nonsense", 2)]
    assert plan.blocks_seconds(blocks, [10.0, 0.0, 40.0, 0.0]) == [10, 15, 40, 30]
    like = "failed, priced like the mean of the other fits:"
    first, second = capsys.readouterr().err.splitlines()
    reason = r"ZeroDivisionError: no such luck\nat all (test_plan.py:"
    assert first.startswith(f"bench: the calibration of raises {like} {reason}")
    assert second == (
        f"bench: the calibration of nonsense {like} fit_seeds returned 7 methods for 2 seeds"
    )


def test_a_method_that_needs_three_demonstrations_is_priced(brought, capsys):
    assert plan.blocks_seconds([block("choosy")], [0.0])[0] >= 0
    assert capsys.readouterr().err == ""


def test_the_table_of_costs_covers_the_preset_paper(tmp_path):
    study = get_preset("paper")
    results = Results(tmp_path)
    agenda = make_agenda(study, demos_keys_of(study), results)
    missing = find_missing(results, [cell.wanted for cell in agenda.cells])
    costs = [job.cost for job in jobs_of(agenda.cells, missing)]
    assert {cost.kind for cost in costs if not cost.known or cost.seconds <= 0} == set()


def test_fits_cost_more_with_more_seeds_demonstrations_and_epochs():
    def cost(seeds=1, **changes):
        fits = [replace(fit, **changes) for fit in block("nn", seeds)]
        return fit_cost(fits).seconds

    by_seeds = [cost(seeds) for seeds in (1, 2, 5, 9)]
    assert by_seeds == sorted(by_seeds)
    assert cost(demos=20) > cost(demos=10)
    assert cost(config={"epochs": 200}) > cost(config={"epochs": 100})


def test_a_method_without_an_entry_is_priced_but_not_known():
    fits = [replace(fit, method="mine") for fit in block("nn")]
    cost = fit_cost(fits)
    assert not cost.known
    assert cost.seconds > 0


def test_the_factor_of_a_machine_is_measured_once(monkeypatch, tmp_path):
    monkeypatch.setenv("BENCH_CACHE", str(tmp_path))
    assert machine.cached_factor() is None
    measured = []
    monkeypatch.setattr(
        machine, "calibrate", lambda: measured.append(1) or 2 * calibration_seconds()
    )
    assert [machine.machine_factor() for _ in range(3)] == [2.0, 2.0, 2.0]
    assert (machine.cached_factor(), len(measured)) == (2.0, 1)
    next(tmp_path.rglob("*.json")).write_text("damaged")
    assert machine.cached_factor() is None


def test_a_shortened_training_predicts_the_cost_of_a_full_one(monkeypatch):
    """The training takes 0.2 s to start; an epoch takes 3 ms, plus 1 ms for each demonstration."""
    monkeypatch.setattr(measuring, "load_demos", lambda task: range(250))
    monkeypatch.setattr(measuring, "split", lambda demos: (demos[:200], demos[200:]))
    monkeypatch.setattr(measuring, "_seconds", lambda work: work())

    def train(demos, epochs):
        return 0.2 + epochs * (0.003 + 0.001 * len(demos))

    found = Price("door", "", "", "", 1, *measuring._training_seconds("door", train))
    assert found.seconds(200, 50) == pytest.approx(0.2 + 50 * 0.203)


def test_a_plan_without_any_price_says_that_fits_are_not_counted(brought, capsys):
    assert plan.blocks_seconds([block("raises")], [0.0]) == [0]
    assert "failed, not counted: ZeroDivisionError" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("raises", "ZeroDivisionError: no such luck"),
        ("nonsense", "AttributeError: 'list' object has no attribute 'values'"),
    ],
)
def test_the_parameter_count_of_a_failing_method_is_unknown(brought, bench, name, reason):
    code, said, _ = bench("describe", name, "--json")
    assert code == 0
    sizes = json.loads(said)["parameters"]
    tasks = ("tool", "door", "relocation", "reorientation")
    assert sizes["one"].pop("reason").startswith(reason)
    assert sizes == {"one": dict.fromkeys(tasks, "unknown")}
    assert "unknown" in bench("describe", name)[1]


def test_parameters_of_a_method_that_needs_three_demonstrations_are_counted(brought, bench):
    sizes = json.loads(bench("describe", "choosy", "--json")[1])["parameters"]
    assert set(sizes["one"].values()) == {0}
