"""Results of pinned kernels and others are never put together."""

from dataclasses import replace
from pathlib import Path

import pytest

import bench as suite
from bench.merge import merge
from bench.other_kernels import check_kernels
from bench.packed import pack
from bench.replay import replay
from bench.results_writer import writing
from bench.sealed_files import read_record, seal_record
from reports.reference import WithShippedMethods
from tasks.errors import InputError
from tasks.pins import PINNED, SWITCH, UNPINNED, State, pin


@pytest.fixture
def unpinned(stored, tmp_path):
    """Results of another seed, computed with other kernels."""
    fit = replace(stored.fit, seed=7, pins=UNPINNED)
    with writing(tmp_path / "unpinned") as writer:
        writer.ask_for([stored.cell(fit, stored.evaluation).wanted])
        writer.add_fit(fit, stored.weights, stored.losses, {"seconds": 1.5})
        writer.add_episodes(fit, stored.evaluation, stored.episodes(0, 4))
    return writer.results


@pytest.fixture
def pinned(monkeypatch):
    """Kernels of this process count as pinned, whatever they are."""
    monkeypatch.setattr("bench.other_kernels.mark", lambda: PINNED)
    monkeypatch.setattr("bench.other_kernels.pin", lambda: State("", late=False))


def test_a_run_refuses_a_folder_with_results_of_other_kernels(stored, unpinned, pinned):
    check_kernels(stored.results)
    answer = (
        f"unpinned holds results of kernels marked {UNPINNED}, and here they are marked {PINNED}:"
        " choose another folder, or set BENCH_PINS=off$"
    )
    with pytest.raises(InputError, match=answer):
        check_kernels(unpinned)


def test_a_run_refuses_a_folder_with_a_controller_of_other_kernels(stored, pinned):
    other = replace(stored.controller, pins=UNPINNED)
    stored.writer.add_controller(other, stored.weights, {})
    answer = f"kernels marked {UNPINNED}, {PINNED}, and here .*: choose another folder$"
    with pytest.raises(InputError, match=answer):
        check_kernels(stored.results)


def test_a_run_refuses_a_folder_that_asks_for_results_of_other_kernels(stored, pinned, tmp_path):
    fit = replace(stored.fit, pins=UNPINNED)
    with writing(tmp_path / "asked") as writer:
        writer.ask_for([stored.cell(fit, stored.evaluation).wanted])
    with pytest.raises(InputError, match=f"asked holds results of kernels marked {UNPINNED}"):
        check_kernels(writer.results)


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_plan_refuses_and_status_names_results_of_other_kernels(
    task, smoke, unpinned, pinned, bench
):
    answer = f"holds results of kernels marked {UNPINNED}"
    code, said, error = bench("plan", "smoke", "--out", str(unpinned.folder), "--jobs", "1")
    assert (code, said) == (2, "")
    assert answer in error
    code, said, _ = bench("status", str(unpinned.folder))
    assert code == 0
    assert f"note: {unpinned.folder} {answer}" in said


@pytest.mark.parametrize("marked", [{}, {"pins": []}, {"pins": "x"}, {"start": {"pins": "x"}}])
def test_a_record_without_a_known_mark_counts_as_damaged(stored, marked, bench, tmp_path):
    path = stored.path("cells/*/fit.json")
    record = read_record(path)
    del record["spec"]["pins"]
    record["spec"] |= marked if "pins" in marked else marked and {"pins": PINNED, **marked}
    path.write_bytes(seal_record(record))
    results, found = stored.results, str(stored.writer.folder)
    assert results.stored_episodes(stored.wanted) == 0
    assert "the mark of its kernels" in results.damaged[path.parent]
    assert bench("merge", found, "--out", str(tmp_path / "out"))[0] == 0
    code, _, error = bench("verify", found)
    assert code == 2
    assert "no evaluations to verify" in error


@pytest.mark.skipif(bool(pin().why_not), reason="not pinned")
def test_a_run_refuses_a_changed_environment_before_it_makes_a_folder(monkeypatch, tmp_path):
    monkeypatch.setenv(SWITCH, "off")
    with pytest.raises(InputError, match="environment has changed"):
        suite.run("smoke", tmp_path / "out", jobs=2)
    assert not (tmp_path / "out").exists()


def test_a_run_in_a_process_with_other_kernels_is_refused_before_it_makes_a_folder(
    monkeypatch, tmp_path
):
    monkeypatch.setattr("tasks.pins.pin", lambda: State(pin().why_not, late=True))
    with pytest.raises(InputError, match="was loaded before kodex-bench"):
        suite.run("smoke", tmp_path / "out", jobs=1, backend="sequential")
    assert not (tmp_path / "out").exists()


def test_a_process_with_other_kernels_replays_episodes_elsewhere(monkeypatch, tmp_path):
    monkeypatch.setattr("bench.replay.pin", lambda: State("", late=True))
    monkeypatch.setattr("bench.replay.apart", lambda job, *arguments: job.__name__)
    row = {"task": "door", "split": "test", "method": "kodex", "episodes": 1}
    assert replay(tmp_path, row, [0]) == "_replay"


@pytest.mark.parametrize("join", [merge, pack])
def test_results_of_different_kernels_are_not_put_together(join, stored, unpinned, tmp_path):
    folders = [stored.results.folder, unpinned.folder]
    answer = f"{PINNED} in {folders[0]}, {UNPINNED} in {folders[1]}"
    with pytest.raises(InputError, match=answer):
        join(folders, tmp_path / "out")
    assert not list(Path(tmp_path / "out").glob("*.parquet")) + list(tmp_path.glob("out/cells"))


def test_a_note_says_that_shipped_results_have_other_kernels(stored, unpinned):
    notes = [WithShippedMethods(one).notes()[-1] for one in (stored.results, unpinned)]
    assert sum("with kernels marked" in note for note in notes) == 1
