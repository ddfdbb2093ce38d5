"""Fits, evaluations and controllers that fail during a run."""

import sys
from dataclasses import replace

import pytest

from bench import load
from bench.backend import Workers
from bench.driver import run
from bench.presets import get_preset
from bench.results import Results as StoredResults
from methods import registry
from methods.kodex import Kodex
from tasks.masses import VARIATIONS
from tasks.recorder import record as record_demos

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)


class Failing(Kodex):
    name = "failing"
    version = 7

    def fit(self, demos, validation, seed):
        if seed == 2:
            raise ZeroDivisionError("seed two never works")
        super().fit(demos, validation, seed)


def test_a_failed_fit_leaves_other_fits_of_the_method_in_the_results(
    task, smoke, bench, tmp_path, monkeypatch
):
    def fit(self, demos, validation, seed):
        if self.config.observables == 2:
            raise ZeroDivisionError("two never works")
        own(self, demos, validation, seed)

    own = Kodex.fit
    monkeypatch.setattr(Kodex, "fit", fit)
    options = ("--out", str(tmp_path), "--jobs", "1", "--experiments", "success")
    for number, code in ((1, 0), (2, 3), (1, 0)):
        setting = ("--set", f"kodex.observables={number}")
        assert bench("run", "smoke", *options, *setting)[0] == code
    assert set(load(tmp_path).method) == {"expert", "kodex"}
    (failure,) = StoredResults(tmp_path).failures()
    assert failure["label"] == "door-kodex-observables=2-described-single-n6-s1"


def test_a_failed_seed_is_stored_as_a_failure_and_the_other_seeds_run(
    task, smoke, bench, tmp_path, monkeypatch
):
    monkeypatch.setattr(registry, "_CLASSES", registry._CLASSES | {"failing": "Failing"})
    monkeypatch.setattr("methods.kodex.Failing", Failing, raising=False)
    monkeypatch.setattr(registry, "import_module", lambda name: sys.modules["methods.kodex"])
    registry.get_method.cache_clear()
    options = ("--methods", "failing", "--experiments", "success", "--seeds", "3", "--jobs", "1")
    for tries in (1, 2):
        code, _, error = bench("run", "smoke", *options, "--out", str(tmp_path))
        assert code == 3
        assert "seed 2: fit raised ZeroDivisionError: seed two never works" in error
        (failure,) = StoredResults(tmp_path).failures()
        assert failure["tries"] == tries
        assert "in fit" in failure["traceback"]
    assert set(StoredResults(tmp_path).frame().seed) == {1, 3}
    monkeypatch.setattr(Failing, "fit", Kodex.fit)
    assert bench("run", "smoke", *options, "--out", str(tmp_path))[0] == 0
    assert StoredResults(tmp_path).failures() == []
    registry.get_method.cache_clear()


def test_a_failure_is_removed_once_its_evaluation_is_completed_in_parts(
    task, smoke, tmp_path, monkeypatch
):
    def rollout(*arguments, **options):
        raise MemoryError("too many episodes")

    study = replace(get_preset("smoke"), episodes={"ood": 8})
    with monkeypatch.context() as patch:
        patch.setattr("bench.computing.rollout", rollout)
        assert len(run(study, tmp_path, Workers(1, "sequential")).failed) == 2
    assert len(StoredResults(tmp_path).failures()) == 2
    monkeypatch.setattr("bench.missing.CHUNK", 2)
    for episodes in (4, 8):
        run(replace(study, episodes={"ood": episodes}), tmp_path, Workers(1, "sequential"))
    assert StoredResults(tmp_path).failures() == []


def test_a_controller_without_successes_to_learn_from_fails_alone(
    task, smoke, tmp_path, monkeypatch
):
    def record(task, starts, expert, physics, failures, raw):
        success, demos = record_demos(task, starts, expert, physics, failures=failures)
        return success, demos[:0] if physics == "heavy_hand" and not failures else demos

    study = replace(get_preset("smoke"), tasks=("door",), episodes={"controllers": 3})
    monkeypatch.setattr("bench.training_data.record", record)
    (failed,) = run(study, tmp_path, Workers(1, "sequential")).failed
    assert failed.startswith(
        "door-tuned-on-successes-heavy_hand-s1: TrainingError: controller of door has no samples"
        " to learn from"
    )
    tried = StoredResults(tmp_path).frame().query("controller == 'tuned-on-successes'").physics
    assert set(tried) == {*VARIATIONS} - {"heavy_hand"}
