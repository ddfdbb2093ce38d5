import json
from dataclasses import asdict
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from statsmodels.stats.contingency_tables import mcnemar

from bench import verify as module
from tasks.demos import demos_key
from tasks.errors import InputError
from tasks.pins import PINNED, UNPINNED, mark
from tasks.registry import get_task


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
    assert "different bits: door-expert-s1 eval-ood-nominal-none-appendix: 13 of 20 stored" in said
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
    found = [line for line in said.splitlines() if line.startswith("told apart: door-expert-s1")]
    assert "eval-ood-nominal-none-appendix: 13 of 20 stored, 0 again" in found[0]


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_results_from_other_demonstrations_are_refused(task, smoke, bench, tmp_path, monkeypatch):
    bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
    monkeypatch.setattr("bench.spec.expert_of", lambda task, chosen, pins: "")
    monkeypatch.setenv("BENCH_CACHE", str(tmp_path / "empty"))
    code, _, error = bench("verify", str(tmp_path), "--jobs", "1")
    assert code == 2
    assert "learnt from other demonstrations" in error
    assert f"(its kernels: {mark()})" in error


def test_results_of_other_kernels_are_refused_with_the_way_out_if_there_is_one(
    stored, monkeypatch, tmp_path
):
    monkeypatch.setattr("bench.other_kernels.mark", lambda: PINNED)
    monkeypatch.setattr(module, "mark", lambda: PINNED)
    monkeypatch.setenv("BENCH_CACHE", str(tmp_path))
    lost = asdict(stored.fit) | {"pins": UNPINNED}
    with pytest.raises(InputError, match=r"learnt from other .* \(its kernels: unpinned\)"):
        module.stored_fit(lost)
    repeatable = lost | {"demos_key": demos_key(get_task("door"), pins=UNPINNED)}
    label = "door-kodex-described-single-n10-s1"
    with pytest.raises(InputError, match=f"^{label} is .* kernels marked unpinned.*: set BENCH_PI"):
        module.stored_fit(repeatable)


@pytest.mark.parametrize(
    ("lost", "evaluations", "verdict"),
    [
        (0, 1, "identical"),
        (5, 1, "cannot be told apart"),
        (6, 1, "told apart"),
        (6, 2, "cannot be told apart"),
        (7, 2, "told apart"),
    ],
)
def test_stored_and_repeated_episodes_are_compared_start_by_start(
    lost, evaluations, verdict, monkeypatch
):
    """Six starts that only one succeeds from have a p-value of 0.031, seven 0.016, five 0.063.

    Those are far within Wilson's interval of 400 in 500.
    """

    def episodes(successes):
        start = np.arange(500)
        success = start < successes
        return pd.DataFrame({"start": start, "success": success, "diverged": False, "steps": 9})

    monkeypatch.setattr(module, "_difference", lambda *arguments: "")
    stored = SimpleNamespace(outcomes=lambda row: episodes(400))
    again = SimpleNamespace(episodes=lambda wanted: episodes(400 - lost))
    cell = SimpleNamespace(
        wanted=None, fit=SimpleNamespace(label="fit"), evaluation=SimpleNamespace(name="test")
    )
    found = module._compare(stored, again, [{}] * evaluations, [cell] * evaluations)
    assert {one.verdict for one in found} == {verdict}
    p = mcnemar([[400 - lost, lost], [0, 100]], exact=True).pvalue
    assert found[0].p == pytest.approx(min(1, evaluations * p))
