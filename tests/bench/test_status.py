"""What `bench status` and `bench plan` count, on runs of a small random expert."""

import json
from dataclasses import replace

import pytest

from bench.backend import Workers
from bench.cli_status import progress
from bench.driver import run
from bench.presets import get_preset
from bench.results import Results as StoredResults
from bench.results_writer import writing

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)


def test_status_counts_stored_results(task, smoke, bench, tmp_path):
    bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
    whole = {"controllers": 1, "controllers_done": 1, "run": None}
    whole |= {"fits": 1, "fits_done": 1, "evaluations": 5, "evaluations_done": 5}
    whole |= {"missing_episodes": 0}
    whole |= {"failures": [], "notes": []}
    assert json.loads(bench("status", str(tmp_path), "--json")[1]) == whole
    next(tmp_path.glob("cells/door-kodex*/eval-test*")).unlink()
    assert "evaluations: 4 of 5 done" in bench("status", str(tmp_path))[1]


def test_status_counts_evaluations_with_all_requested_episodes(task, smoke, tmp_path, capsys):
    run(get_preset("smoke"), tmp_path, Workers(1, "sequential"))
    results = StoredResults(tmp_path)
    wanted = {one.place: one for one in results.manifest().wanted}
    label = "door-kodex-described-single-n6-s0"
    test, ood = (
        wanted[label, f"eval-{split}-nominal-original-appendix"] for split in ("test", "ood")
    )
    more = replace(test, episodes=test.episodes + 1)
    other = replace(ood, evaluation=replace(ood.evaluation, key=64 * "0"))
    with writing(tmp_path) as writer:
        writer.ask_for([more, other])
    assert progress(results)["evaluations_done"] == 3
    with writing(tmp_path) as writer:
        writer.ask_for([test])
    assert progress(results)["evaluations_done"] == 4
    next(tmp_path.glob("cells/door-kodex*/eval-test*")).write_bytes(b"damaged")
    assert progress(results)["evaluations_done"] == 3
    next(tmp_path.glob("cells/door-kodex*/weights*")).write_bytes(b"damaged")
    assert progress(results)["evaluations_done"] == 2
    assert capsys.readouterr().err.count("is damaged") == 2


def test_plan_estimates_only_missing_results(task, smoke, bench, tmp_path):
    options = ("smoke", "--jobs", "1", "--out", str(tmp_path))
    before = json.loads(bench("plan", *options, "--json")[1])
    assert before["cells"] == before["missing_evaluations"] == 5
    assert (before["missing_controllers"], before["missing_fits"]) == (1, 1)
    assert before["missing_episodes"] == 2 + 4 * 20
    assert before["cpu_hours"] >= before["wall_hours"] > before["longest_hours"] > 0
    bench("run", *options)
    after = json.loads(bench("plan", *options, "--json")[1])
    assert (after["missing_fits"], after["missing_episodes"], after["cpu_hours"]) == (0, 0, 0)
    assert "5 cells; missing: 0 controllers" in bench("plan", *options)[1]


def test_plan_refuses_a_study_that_exceeds_memory_or_disk(
    task, smoke, bench, tmp_path, monkeypatch
):
    options = ("plan", "smoke", "--out", str(tmp_path), "--jobs", "1")
    for name, value, answer in (
        ("GIB_PER_JOB", 1e6, "choose fewer with --jobs"),
        ("BYTES_PER_STEP", 1e15, "choose fewer episodes, or another folder"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(f"bench.plan.{name}", value)
            code, _, error = bench(*options)
        assert code == 2
        assert answer in error
