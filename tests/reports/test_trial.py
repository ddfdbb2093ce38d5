"""`bench try` with a small random expert and results shipped for it."""

import json
import re
import shlex
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pandas as pd
import pytest
from resealed import pack_evaluations

from bench.controller import ControllerConfig
from bench.experiments import cells_of
from bench.names import PLAIN
from bench.packed import shipped
from bench.results import Results as StoredResults
from bench.studies import study_of
from bench.study_demos import demos_keys_of
from methods.kodex import Kodex
from reports.results import Results
from reports.trial import Trial
from tasks.data import generator
from tasks.pins import mark

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)


class Shipped(Results):
    """Shipped results with a rate for each method, which fails on the hardest starts."""

    rates = MappingProxyType({"ndp": 0.5, "nn": 0.84, "kodex": 0.8})
    rows = property(lambda self: self)

    def __init__(self, cell):
        self.cell = cell

    def main(self, **values):
        assert values == {"task": "door", "split": "test", "seed": 1}
        row = asdict(self.cell.fit) | {"controller_key": self.cell.controller.key}
        row |= PLAIN | {"split": "test", "controller": "original", "episodes": 1000}
        names = ("expert", *self.rates)
        return pd.DataFrame([row | {"method": name, "folder": name} for name in names])

    def outcomes(self, row):
        success = generator("hard").random(1000) < self.rates[row["method"]]
        return pd.DataFrame({"success": success, "diverged": False})


def test_shipped_methods_are_sorted_by_rate_and_compared_on_the_same_starts(task):
    study = study_of(
        "paper", experiments="success", methods="kodex", tasks="door", seeds=(1,), episodes=400
    )
    (cell,) = cells_of(study, {"door": "key"})
    shipped = Shipped(cell)
    trial = Trial(cell, shipped.outcomes({"method": "kodex"}).success[:400].to_numpy())
    table = trial.compare(shipped)
    assert list(table.method) == ["nn", "kodex", "ndp"]
    ahead, same, behind = table.to_dict("records")
    assert ahead["difference"] == pytest.approx(trial.rate["success"] - ahead["success"])
    assert ahead["difference_high"] < 0 < behind["difference_low"]
    assert same["difference_low"] < 0 < same["difference_high"]
    assert (same["difference"], same["p"]) == (0, 1)
    assert set(table.basis) == {trial.rate["basis"]} == {"this fit and this controller only"}
    # Both fail on hard starts, so paired differences are sharper than separate intervals.
    assert ahead["low"] < trial.rate["high"]


def tried(bench, *options):
    code, said, _ = bench("try", "kodex", *options, "--json")
    assert code == 0
    return json.loads(said)


@pytest.mark.parametrize(("tried", "beside"), [("bc", True), ("nearest", False)])
def test_closed_loop_methods_stand_beside_a_closed_loop_one_alone(task, tried, beside):
    study = study_of("paper", experiments="success", tasks=task.name, methods=tried, seeds=1)
    (cell,) = cells_of(study, demos_keys_of(study))
    shown = Trial(cell, np.ones(20, bool))._others(Results(shipped())).method
    assert {"kodex", "regression"} <= {*shown}
    assert ({"bc", "chunk", "flow"} <= {*shown}) == beside
    assert beside or not {"bc", "chunk", "flow"} & {*shown}


def test_shipped_methods_are_shown_on_the_starts_of_the_trial(bench, reference):
    theirs = reference()
    found = tried(bench, "--episodes", "7")
    assert (found["method"], found["task"], found["demos"], found["n"]) == ("kodex", "door", 6, 7)
    rows = {row["method"]: row for row in found["shipped"]}
    assert set(rows) == {"kodex", "nn"}
    (stored,) = theirs.frame().query("method == 'nn' and seed == 1").to_dict("records")
    rate = theirs.outcomes(stored).success[:7].mean()
    assert rows["nn"]["success"] == pytest.approx(100 * rate)
    assert (rows["nn"]["seeds"], rows["nn"]["n"]) == (1, 7)
    assert rows["kodex"]["success"] == found["success"]
    assert (rows["kodex"]["difference"], rows["kodex"]["p"]) == (0, 1)
    rates = [row["success"] for row in found["shipped"]]
    assert rates == sorted(rates, reverse=True)


def test_difference_uses_common_starts_if_fewer_are_shipped(bench, reference):
    reference(episodes={"success": 5})
    found = tried(bench, "--episodes", "8")
    (row,) = (row for row in found["shipped"] if row["method"] == "kodex")
    assert (found["n"], row["n"], row["difference"]) == (8, 5, 0)
    assert "starts, on the first 5 starts" in bench("try", "kodex", "--episodes", "8")[1]


def test_output_shows_rates_and_commands_for_failures(bench, reference):
    reference()
    numbers = tried(bench, "--episodes", "7", "--out", "my results")
    code, said, _ = bench("try", "kodex", "--episodes", "7", "--out", "my results")
    assert code == 0
    assert re.match(r"kodex on door · 6 demos · seed 1 · first 7 starts of test +\d+ s\n", said)
    assert "{success:.1f} [{low:.1f}, {high:.1f}]".format(**numbers) in said
    assert re.search(r"^  NN +\d", said, re.M)
    assert "same demos, controller and starts." in said
    assert "Brackets: 95% intervals of this fit and this controller only." in said
    first = numbers["failures"][0]
    assert "bench failures 'my results' --method kodex --task door --seed 1\n" in said
    assert said.endswith(f"--results 'my results' --methods kodex --seed 1 --start {first}\n")
    film = shlex.split(said.splitlines()[-1].partition("bench ")[2])
    known = bench(film[0], "--help")[1]
    assert [word for word in film if word.startswith("--") and word not in known] == []


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"demos": 5}, {"number of demonstrations", "controller"}),
        ({"controller": ControllerConfig(epochs=6)}, {"controller"}),
    ],
)
def test_shipped_methods_run_differently_are_omitted_and_the_differences_named(
    bench, reference, changes, named
):
    reference(**changes)
    found = tried(bench, "--episodes", "4")
    assert found["shipped"] == []
    assert {row["setting"] for row in found["unlike"]} == named
    said = bench("try", "kodex", "--episodes", "4")[1]
    assert "The shipped methods were run otherwise and are left out" in said
    assert "NN" not in said


def test_differing_kernels_are_named_and_not_the_keys_that_cover_them(bench, reference, tmp_path):
    reference()
    theirs = pd.read_parquet(tmp_path / "small/evaluations.parquet")
    changes = {"pins": "other", "demos_key": "other", "controller_key": "other"}
    pack_evaluations(tmp_path / "small", theirs.assign(**changes))
    found = tried(bench, "--episodes", "4")
    assert found["shipped"] == []
    assert found["unlike"] == [{"setting": "kernels", "here": mark(), "shipped": "other"}]


def test_differing_demonstrations_and_mujoco_are_named(bench, reference, monkeypatch, tmp_path):
    reference(demos=5)
    theirs = pd.read_parquet(tmp_path / "small/evaluations.parquet")
    pack_evaluations(tmp_path / "small", theirs.assign(demos_key="other"))
    monkeypatch.setattr("reports.trial.version", lambda package: "3.0")
    found = tried(bench, "--episodes", "4")
    assert found["shipped"] == []
    rows = {row["setting"]: (row["here"], row["shipped"]) for row in found["unlike"]}
    assert set(rows) == {"number of demonstrations", "demonstrations", "controller", "MuJoCo"}
    assert rows["number of demonstrations"] == ("6", "5")
    assert rows["demonstrations"][1] == "other"
    assert rows["MuJoCo"][0] == "3.0"


def test_try_evaluates_the_method_alone_and_once(bench, reference):
    reference()
    first, again = (tried(bench, "--episodes", "4") for _ in range(2))
    assert first | {"seconds": 0} == again | {"seconds": 0}
    frame = StoredResults(Path("results/try")).frame()
    assert list(zip(frame.method, frame.episodes, strict=True)) == [("kodex", 4)]
    assert frame.config[0]["observables"] == 3
    assert tried(bench, "--episodes", "4", "--set", "kodex.observables=2")["n"] == 4


def test_predictions_that_are_not_finite_count_as_diverged(bench, reference, monkeypatch):
    reference()

    def rollout(self, start, steps):
        motion = np.repeat(start[:, None], steps + 1, axis=1)
        motion[:, 2:] = np.nan
        return motion

    monkeypatch.setattr(Kodex, "rollout", rollout)
    found = tried(bench, "--episodes", "4")
    assert (found["success"], found["diverged"], found["failures"]) == (0, 4, [0, 1, 2, 3])
    assert "4 failed (4 diverged): " in bench("try", "kodex", "--episodes", "4")[1]


def test_error_in_a_method_names_task_file_and_line(bench, paper, monkeypatch):
    def fit(self, demos, validation, seed):
        raise ZeroDivisionError("no scale")

    monkeypatch.setattr(Kodex, "fit", fit)
    code, said, error = bench("try", "kodex")
    assert (code, said) == (3, "")
    assert re.search(r"door-kodex.*ZeroDivisionError: no scale \(.*test_trial\.py:\d+", error), (
        error
    )


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (("kodx",), "did you mean 'kodex'"),
        (("kodex", "--task", "dor"), "did you mean 'door'"),
        (("kodex", "--set", "nn.epochs=1"), "nn is not among the methods of the run"),
        (("kodex", "--seed", "0"), "must be a whole number from 1"),
    ],
)
def test_unknown_names_and_values_are_refused(bench, paper, words, answer):
    code, said, error = bench("try", *words)
    assert (code, said) == (2, "")
    assert answer in re.sub(r"[\s│]+", " ", error)
