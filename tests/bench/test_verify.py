import json

import pytest

from bench import verify as module


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_verify_finds_results_of_this_machine_identical(task, smoke, bench, tmp_path):
    bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
    options = ("verify", str(tmp_path), "--cells", "9", "--jobs", "1")
    code, said, _ = bench(*options, "--json")
    found = json.loads(said)
    assert code == 0
    assert len(found) == 5
    assert {one["verdict"] for one in found} == {"identical"}
    assert {one["episodes"] for one in found} == {2, 20}
    code, said, _ = bench(*options, "--episodes", "4")
    assert (
        "identical: door-expert-s1 eval-ood-nominal-none-appendix: 2 of 4 stored, 2 again" in said
    )


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_verify_names_bits_that_differ(task, smoke, bench, tmp_path, monkeypatch):
    bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
    monkeypatch.setattr(type(task), "success", lambda self, r: r[:, -1] > 1e9)
    code, said, _ = bench("verify", str(tmp_path), "--cells", "9", "--jobs", "1")
    assert code == 3
    assert "different bits: door-expert eval-ood-nominal-none-appendix: 13 of 20 stored" in said
    assert "success of episode 1 is True in one, False in the other" in said


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_verify_judges_results_of_other_software_by_their_success(
    task, smoke, bench, tmp_path, monkeypatch
):
    bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
    monkeypatch.setattr("bench.same_bits.same_bits", lambda stored, again: False)
    monkeypatch.setattr(type(task), "success", lambda self, r: r[:, -1] > 1e9)
    code, said, _ = bench("verify", str(tmp_path), "--cells", "9", "--jobs", "1")
    assert code == 3
    assert (
        "\ntold apart: door-expert-s1 eval-ood-nominal-none-appendix: 13 of 20 stored, 0 ag" in said
    )


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_results_from_other_demonstrations_are_refused(task, smoke, bench, tmp_path, monkeypatch):
    bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
    monkeypatch.setattr(module, "demos_key", lambda task: "other")
    monkeypatch.setenv("BENCH_CACHE", str(tmp_path / "empty"))
    code, _, error = bench("verify", str(tmp_path), "--jobs", "1")
    assert code == 2
    assert "learnt from other demonstrations" in error
