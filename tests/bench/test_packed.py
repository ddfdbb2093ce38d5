"""`bench pack`, on runs of a small random expert."""

import json

import pandas as pd
import pytest

from bench.results_writer import writing
from methods.kodex import Kodex

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)


def without_motions(files):
    """Files of a report on packed results: motions need fits, which are not packed."""
    return {name: digest for name, digest in files.items() if "/motions." not in name}


def test_packed_results_give_the_same_report(task, smoke, bench, tmp_path, files_of):
    out, small = tmp_path / "results", tmp_path / "small"
    bench("run", "smoke", "--out", str(out), "--jobs", "1")
    bench("report", str(out))
    code, said, _ = bench("pack", str(out), "--out", str(small))
    assert code == 0
    assert f"bench report {small} shows them" in said
    assert len({path.stat().st_mode for path in small.iterdir()}) == 1  # all who may read one
    bench("report", str(small))
    assert files_of(small / "report") == without_motions(files_of(out / "report"))
    found = json.loads(bench("verify", str(small), "--jobs", "1", "--cells", "9", "--json")[1])
    assert [one["verdict"] for one in found] == ["identical"] * 5


def test_packed_parts_equal_one_run(task, smoke, bench, tmp_path, files_of, monkeypatch):
    folders = [tmp_path / name for name in ("whole", "part", "more", "packed", "other")]
    whole, part, more, packed, other = map(str, folders)
    run = ("run", "smoke", "--jobs", "1", "--out")
    bench(*run, whole)
    bench(*run, part, "--episodes", "5")
    bench(*run, more, "--experiments", "success,ood")
    bench("pack", part, "--out", packed)
    alone = pd.read_parquet(tmp_path / "packed/evaluations.parquet")
    with writing(tmp_path / "empty") as empty:
        empty.ask_for([])
    bench("pack", part, str(empty.folder), "--out", packed)
    beside = pd.read_parquet(tmp_path / "packed/evaluations.parquet")
    pd.testing.assert_frame_equal(beside, alone)
    assert bench("pack", packed, more, "--out", packed)[0] == 0
    episodes = pd.read_parquet(tmp_path / "packed/episodes.parquet")
    assert len(episodes) == 2 * (20 + 20) + 2
    for folder in (whole, packed):
        bench("report", folder)
    ours = files_of(tmp_path / "whole/report")
    assert files_of(tmp_path / "packed/report") == without_motions(ours)
    monkeypatch.setattr(Kodex, "version", Kodex.version + 1)
    bench(*run, other)
    code, _, error = bench("pack", packed, other, "--out", packed)
    assert code == 2
    assert "different results of door-kodex-described-single-n6-s1" in error
    pd.testing.assert_frame_equal(episodes, pd.read_parquet(tmp_path / "packed/episodes.parquet"))


def test_results_are_not_packed_into_a_folder_of_a_run(task, smoke, bench, tmp_path):
    run = str(tmp_path / "run")
    bench("run", "smoke", "--jobs", "1", "--episodes", "2", "--out", run)
    code, _, error = bench("pack", run, "--out", run)
    assert (code, "pack into another folder" in error) == (2, True)
    assert bench("status", run)[0] == 0


def test_pack_keeps_times_when_a_part_with_more_episodes_has_none(task, smoke, bench, tmp_path):
    timed, more, packed = (str(tmp_path / name) for name in ("timed", "more", "packed"))
    run = ("run", "smoke", "--jobs", "1", "--out")
    bench(*run, timed, "--episodes", "5")
    bench("time", timed)
    bench(*run, more)
    bench("pack", timed, more, "--out", packed)
    rows = pd.read_parquet(tmp_path / "packed/evaluations.parquet").query("method == 'kodex'")
    assert rows.fit_seconds.notna().all()
    assert (rows[rows.split != "validation"].episodes > 5).all()


@pytest.mark.parametrize(
    "name",
    ["evaluations.parquet", "episodes.parquet", "diagnostics.safetensors", "provenance.json"],
)
def test_damage_to_packed_results_is_named(task, smoke, bench, tmp_path, name):
    out, small = tmp_path / "results", tmp_path / "small"
    bench("run", "smoke", "--out", str(out), "--jobs", "1")
    bench("pack", str(out), "--out", str(small))
    content = bytearray((small / name).read_bytes())
    content[len(content) // 2] ^= 1
    (small / name).write_bytes(content)
    code, _, error = bench("report", str(small))
    # Without diagnostics, only the exhibits that show them are left out.
    assert code == (3 if name.startswith("diagnostics") else 2)
    assert f"{name} is damaged" in error
