"""`bench merge`, on runs of a small random expert."""

from dataclasses import replace

import pandas as pd
import pytest

from bench.backend import Workers
from bench.controller import ControllerConfig
from bench.driver import run
from bench.merge import merge
from bench.packed import pack
from bench.presets import get_preset
from bench.results import Results as StoredResults
from bench.results_writer import writing
from bench.source import TIMES
from methods.kodex import Kodex
from tasks.errors import InputError

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)


def test_merged_parts_equal_one_run(task, smoke, bench, tmp_path, files_of):
    whole, a, b, c = (tmp_path / name for name in ("whole", "a", "b", "c"))
    options = ("run", "smoke", "--jobs", "1")
    bench(*options, "--out", str(whole))
    bench(*options, "--out", str(a), "--experiments", "sizes,stability")
    bench(*options, "--out", str(b), "--experiments", "success", "--episodes", "4")
    bench(*options, "--out", str(c), "--experiments", "success,ood")
    bench("time", str(c))
    code, said, _ = bench("merge", str(a), str(b), str(c), "--out", str(tmp_path / "out"))
    assert (code, said) == (0, f"2 fits in {tmp_path / 'out'}\n")
    assert files_of(tmp_path / "out") == files_of(whole)
    merged, alone = StoredResults(tmp_path / "out").frame(), StoredResults(whole).frame()
    assert (merged[merged.method == "kodex"].fit_seconds > 0).all()
    pd.testing.assert_frame_equal(merged.drop(columns=[*TIMES]), alone.drop(columns=[*TIMES]))


@pytest.mark.parametrize(
    "name",
    ["cells/door-kodex*/eval-test*", "cells/door-kodex*/weights*", "controllers/*/weights*"],
)
def test_merge_replaces_damaged_files_of_the_target(
    task, smoke, tmp_path, capsys, files_of, name, damage
):
    whole, out = tmp_path / "whole", tmp_path / "out"
    run(get_preset("smoke"), whole, Workers(1, "sequential"))
    merge([whole], out)
    damage(next(out.glob(name)))
    merge([whole], out)
    assert files_of(out) == files_of(whole)
    assert "set aside as" in capsys.readouterr().err


def test_merged_results_are_no_failures_any_more(task, smoke, tmp_path):
    whole, out = tmp_path / "whole", tmp_path / "out"
    run(get_preset("smoke"), whole, Workers(1, "sequential"))
    wanted = StoredResults(whole).manifest().wanted[-1]
    with writing(out) as writer:
        writer.ask_for([])
        labels = (wanted.fit.label, f"{wanted.fit.label} {wanted.evaluation.label}")
        for label in (*labels, *(controller.label for controller in wanted.controllers)):
            writer.add_failure(label, "it raised", "")
        assert writer.results.failures()
    merge([whole], out)
    assert not StoredResults(out).failures()


def test_merge_flushes_files_before_they_appear(task, smoke, tmp_path, monkeypatch):
    def fail(handle):
        raise OSError("full")

    run(get_preset("smoke"), tmp_path / "whole", Workers(1, "sequential"))
    monkeypatch.setattr("os.fsync", fail)
    with pytest.raises(OSError, match="full"):
        merge([tmp_path / "whole"], tmp_path / "out")
    assert not (tmp_path / "out/cells").exists()


def test_merge_keeps_the_longer_of_two_evaluations_wherever_it_stands(task, smoke, bench, tmp_path):
    folders = [tmp_path / name for name in ("whole", "part")]
    for folder, episodes in zip(folders, ("7", "3"), strict=True):
        bench("run", "smoke", "--jobs", "1", "--out", str(folder), "--episodes", episodes)
    for place, order in enumerate((folders, folders[::-1])):
        out = tmp_path / f"out{place}"
        merge(order, out)
        frame = StoredResults(out).frame()
        assert set(frame[frame.split == "test"].episodes) == {7}
        assert StoredResults(out).manifest().wanted == StoredResults(folders[0]).manifest().wanted


def test_merge_refuses_results_with_other_controllers(task, smoke, bench, tmp_path):
    for name, epochs in (("a", 5), ("b", 6)):
        study = replace(get_preset("smoke"), controller=ControllerConfig(epochs=epochs))
        run(study, tmp_path / name, Workers(1, "sequential"))
    with pytest.raises(InputError, match="the version, config, controller or demonstrations"):
        merge([tmp_path / "a", tmp_path / "b"], tmp_path / "out")
    with pytest.raises(InputError, match="the version, config, controller or demonstrations"):
        pack([tmp_path / "a", tmp_path / "b"], tmp_path / "packed")
    assert not list(tmp_path.glob("packed/*"))


def test_merge_refuses_results_of_different_versions(task, smoke, bench, tmp_path, monkeypatch):
    for name, version in (("a", 1), ("b", 2)):
        monkeypatch.setattr(Kodex, "version", version)
        bench("run", "smoke", "--out", str(tmp_path / name), "--jobs", "1")
    folders = (str(tmp_path / "a"), str(tmp_path / "b"))
    code, _, error = bench("merge", *folders, "--out", str(tmp_path / "out"))
    assert code == 2
    assert "holds other results of door-kodex-described-single-n6-s1" in error
    assert not (tmp_path / "out/cells").exists()
