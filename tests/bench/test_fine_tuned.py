"""Runs of fine-tuned controllers, which need the original controller of their seed."""

from dataclasses import replace

import pytest

from bench import driver
from bench.backend import Workers
from bench.controller import ControllerConfig, train_controllers
from bench.driver import run
from bench.experiments import cells_of
from bench.job_queue import JobQueue
from bench.jobs import ControllerJob, jobs_of
from bench.merge import merge
from bench.missing import find_missing
from bench.presets import get_preset
from bench.results import Results
from bench.study_demos import demos_keys_of
from bench.training_data import controller_demos
from bench.verify import stored_cell
from tasks import demos
from tasks.files import from_bytes

SHORT = ControllerConfig(epochs=2)


@pytest.fixture
def study(monkeypatch):
    """KODex with original and fine-tuned controllers in one changed physics, two seeds."""
    monkeypatch.setattr("tasks.adroit.VARIATIONS", ("heavy_hand",))
    monkeypatch.setattr("bench.experiments.READINGS", {"door": ()})
    return replace(
        get_preset("smoke"),
        methods=("kodex",),
        seeds=(1, 2),
        episodes={"success": 2, "controllers": 2},
        demos=6,
        controller=SHORT,
    )


def fine_tuned(results):
    rows = results.frame().query("controller == 'fine-tuned' and method == 'kodex'")
    return [stored_cell(results, row, 2).controller for row in rows.to_dict("records")]


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_fine_tuned_controllers_start_from_the_stored_original_of_their_seed(
    task, smoke, study, tmp_path
):
    assert run(study, tmp_path / "run", Workers(1, "sequential")).failed == ()
    results = Results(tmp_path / "run")
    found = fine_tuned(results)
    assert [spec.seed for spec in found] == [1, 2]
    for spec in found:
        own, start = (from_bytes(results.controller_weights(one)) for one in (spec, spec.start))
        data, place = [controller_demos(spec)], ("door", [spec.seed])
        (further,), (anew,) = (
            train_controllers(SHORT, data, *place, first) for first in ([start], [])
        )
        assert all((own[name] == array).all() for name, array in further.items())
        assert all((own[name] != array).any() for name, array in anew.items())


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_fine_tuned_controller_waits_for_the_original_and_fails_with_it(
    task, smoke, study, tmp_path
):
    cells = cells_of(study, demos_keys_of(study))
    tuned = [c for c in cells if c.controller and c.controller.kind == "fine-tuned"]
    missing = find_missing(Results(tmp_path), [cell.wanted for cell in tuned])
    queue = JobQueue(job for job in jobs_of(tuned, missing) if isinstance(job, ControllerJob))
    first = queue.take()
    assert [spec.label for spec in first.specs] == [f"door-original-nominal-s{s}" for s in (1, 2)]
    assert queue.take() is None
    assert [job.label for job in queue.waiting] == ["door-fine-tuned-heavy_hand-s1,2"]
    queue.fail(first.makes[0])
    assert queue.waiting == []


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_merged_results_hold_the_controllers_that_others_start_from(task, smoke, study, tmp_path):
    study = replace(study, seeds=(1,))
    run(study, tmp_path / "one", Workers(1, "sequential"))
    merge([tmp_path / "one"], tmp_path / "merged")
    merged = Results(tmp_path / "merged")
    assert all(merged.has_controller(spec.start) for spec in fine_tuned(merged))
    assert find_missing(merged, merged.manifest().wanted).controllers == frozenset()


def test_two_seeds_are_fine_tuned_on_loky(study, tmp_path, monkeypatch):
    monkeypatch.setenv("BENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(demos, "TRAINING", 6)
    monkeypatch.setattr(demos, "VALIDATION", 2)
    monkeypatch.setattr("tasks.recorder.BLOCK", 10)
    monkeypatch.setattr(driver, "TRAINING", 6)
    assert run(study, tmp_path / "run", Workers(2)).failed == ()
    results = Results(tmp_path / "run")
    assert [spec.seed for spec in fine_tuned(results)] == [1, 2]
    assert find_missing(results, results.manifest().wanted).controllers == frozenset()
