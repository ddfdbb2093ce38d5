"""What the calibration of `bench plan`, `bench time` and `bench describe` measures."""

import json
import time
from dataclasses import asdict, dataclass
from typing import ClassVar

import pytest

from bench import plan
from bench.jobs import fit_job
from bench.spec import Evaluation, Fit
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
    """Methods of other packages beside KODex and NN, called in this process."""
    monkeypatch.setattr(registry, "SUITE", tuple(METHODS))
    monkeypatch.setattr(plan, "SUITE", tuple(METHODS))
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
        Fit("door", method, "described", size, asdict(config), 10, seed, "recipe")
        for seed in range(1, seeds + 1)
    ]


def sharing(function, share=3):
    """Takes as long as the function does on a core that it shares with other processes."""

    def shared(*arguments, **options):
        began = time.perf_counter()
        result = function(*arguments, **options)
        time.sleep(share * (time.perf_counter() - began))
        return result

    return shared


def price_of_an_episode():
    plan._whole_episode_seconds.cache_clear()
    return plan.episode_seconds(Evaluation("door", "test"))


def price_of_a_fit():
    plan._unit_seconds.cache_clear()
    return plan.fits_seconds(block("kodex"))


def price_of_a_controller():
    plan._unit_controller_seconds.cache_clear()
    return plan._unit_controller_seconds("door")


def time_of_a_fit():
    return fit_job(block("kodex"), *plan.random_demos("door"))[0].seconds


@pytest.mark.parametrize("task", ["door"], indirect=True)
@pytest.mark.parametrize(
    ("price", "place", "name"),
    [
        (price_of_an_episode, plan, "rollout"),
        (price_of_a_controller, plan, "train_controller"),
        (price_of_a_fit, Kodex, "fit"),
        (time_of_a_fit, Kodex, "fit"),
    ],
)
def test_a_busy_machine_does_not_raise_a_price(price, place, name, task, shipped, monkeypatch):
    price()
    alone = min(price() for _ in range(3))
    monkeypatch.setattr(place, name, sharing(getattr(place, name)))
    assert min(price() for _ in range(3)) < 2 * alone


def test_a_method_that_fails_in_the_calibration_costs_the_mean_of_the_others(brought, capsys):
    blocks = [block("kodex"), block("raises"), block("nn", 2), block("nonsense", 2)]
    kodex, raises, nn, nonsense = plan.blocks_seconds(blocks)
    mean = (kodex + nn / 2) / 2
    assert (raises, nonsense) == (pytest.approx(mean), pytest.approx(2 * mean))
    like = "failed, priced like the mean of the other fits:"
    first, second = capsys.readouterr().err.splitlines()
    reason = r"ZeroDivisionError: no such luck\nat all (test_plan.py:"
    assert first.startswith(f"bench: the calibration of raises {like} {reason}")
    assert second == (
        f"bench: the calibration of nonsense {like} fit_seeds returned 7 methods for 2 seeds"
    )


def test_a_method_that_needs_three_demonstrations_is_priced(brought, capsys):
    assert plan.blocks_seconds([block("choosy")])[0] >= 0
    assert capsys.readouterr().err == ""


def test_a_plan_without_any_price_says_that_fits_are_not_counted(brought, capsys):
    assert plan.blocks_seconds([block("raises")]) == [0]
    assert "failed, not counted: ZeroDivisionError" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("raises", "ZeroDivisionError: no such luck"),
        ("nonsense", "AttributeError: 'list' object has no attribute 'values'"),
    ],
)
def test_numbers_of_a_method_that_fails_are_unknown(brought, bench, name, reason):
    code, said, _ = bench("describe", name, "--json")
    assert code == 0
    sizes = json.loads(said)["parameters"]
    tasks = ("tool", "door", "relocation", "reorientation")
    assert sizes["one"].pop("reason").startswith(reason)
    assert sizes == {"one": dict.fromkeys(tasks, "unknown")}
    assert "unknown" in bench("describe", name)[1]


def test_numbers_of_a_method_that_needs_three_demonstrations_are_counted(brought, bench):
    sizes = json.loads(bench("describe", "choosy", "--json")[1])["parameters"]
    assert set(sizes["one"].values()) == {0}
