"""`bench report` and `compare`, on runs of a small random expert."""

import json
import re
from dataclasses import replace

import pandas as pd
import pytest

from bench import load
from bench import run as run_from_python
from bench.backend import Workers
from bench.controller import ControllerConfig
from bench.driver import run
from bench.presets import get_preset
from bench.results import Results as StoredResults
from tasks.demos import load_demos
from tasks.demos_files import save_demos

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)


def test_report_exports_every_episode_in_one_table(task, smoke, bench, tmp_path):
    out, export = tmp_path / "results", tmp_path / "episodes.parquet"
    run_from_python("smoke", out, jobs=1)
    code, _, _ = bench("report", str(out), "--export", str(export))
    assert code == 0
    table = pd.read_parquet(export)
    pd.testing.assert_frame_equal(table, load(out))
    assert len(table) == 2 + 4 * 20
    frame = StoredResults(out).frame()
    counted = table.groupby(["method", "split"], observed=True).success.sum()
    assert dict(counted) == dict(frame.set_index(["method", "split"]).successes)


def test_the_report_has_table_1_with_interval_n_and_the_published_value(
    task, smoke, bench, tmp_path
):
    bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
    code, said, _ = bench("report", str(tmp_path))
    assert code == 0
    assert "| KODex  |" in said
    folder = tmp_path / "report"
    header, row = (folder / "tables/table_1.csv").read_text().splitlines()
    assert header.startswith("row,column,value,spread,low,high,basis,seeds,n,diverged,published,")
    assert row.split(",")[:2] == ["kodex", "door"]
    basis = "this fit and this controller only"
    assert row.split(",")[6:11] == [basis, "1", "2", "0", "96.0"]
    assert r"\toprule" in (folder / "tables/table_1.tex").read_text()
    for ending in ("png", "pdf", "svg"):
        assert (folder / f"figures/table_1.{ending}").stat().st_size > 1000


def test_report_leaves_out_a_failing_exhibit_and_ends_with_exit_code_3(
    task, smoke, bench, tmp_path, monkeypatch
):
    bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
    monkeypatch.setattr("reports.results.Results.diagnostics", lambda self, folder: {})
    code, said, error = bench("report", str(tmp_path))
    assert code == 3
    assert "bench: left out: Table 12: largest eigenvalue magnitude: InputError: " in error
    assert "has stored no eigenvalues" in error
    assert "## Success on test starts" in said


def test_report_prints_the_success_table_and_with_tables_prints_all(task, smoke, bench, tmp_path):
    bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
    code, said, _ = bench("report", str(tmp_path))
    assert code == 0
    titles = [line for line in said.splitlines() if line.startswith("## ")]
    assert titles == ["## Success on test starts"]
    assert "Door: KODex is the only method, " in said
    assert said.endswith(
        f" tables to {tmp_path / 'report'}\npage: {tmp_path / 'report/index.html'}\n"
    )
    assert "numbers mean nothing" in said
    said = bench("report", str(tmp_path), "--tables")[1]
    assert "## Table 1: success of KODex on the validation starts" in said
    assert "95% interval" in said


def test_results_of_two_settings_appear_as_two_methods(task, smoke, bench, tmp_path):
    options = ("--out", str(tmp_path), "--jobs", "1", "--experiments", "success")
    labels = [f"kodex:observables={number}" for number in (1, 2)]
    for number in (1, 2):
        bench("run", "smoke", *options, "--set", f"kodex.observables={number}")
    assert set(load(tmp_path).method) == {"expert", *labels}
    for names in ("kodex", ",".join(labels)):
        pairs = json.loads(bench("compare", str(tmp_path), "--methods", names, "--json")[1])
        assert [[pair["left"], pair["right"]] for pair in pairs] == [labels]
    for label in labels:
        words = ("--method", label, "--task", "door")
        code, said, _ = bench("failures", str(tmp_path), *words)
        assert code == 0
        assert f"| door   | {label} " in said
    assert bench("report", str(tmp_path))[0] == 0
    table = (tmp_path / "report/tables/success.md").read_text()
    for number in (1, 2):
        assert f"KODex observables={number} " in table


def test_with_reference_adds_shipped_methods_that_a_run_lacks(
    task, smoke, bench, tmp_path, monkeypatch
):
    out, theirs, small = tmp_path / "mine", tmp_path / "theirs", tmp_path / "small"
    options = ("--jobs", "1", "--set", "nn.epochs=1", "--out")
    bench("run", "smoke", "--methods", "kodex,nn", *options, str(theirs))
    bench("run", "smoke", "--methods", "kodex", *options[:2], "--out", str(out))
    bench("pack", str(theirs), "--out", str(small))
    monkeypatch.setattr("bench.packed.SHIPPED", small)
    export = tmp_path / "all.parquet"
    code, _, error = bench("report", str(out), "--with-reference", "--export", str(export))
    assert (code, error) == (0, "")
    assert "as shipped: nn." in (out / "report/index.html").read_text()
    rows = (out / "report/tables/success.csv").read_text()
    assert "nn,door" in rows
    assert set(pd.read_parquet(export).method) == {"kodex", "nn"}
    pair = ("--methods", "kodex,nn", "--json")
    rows = json.loads(bench("compare", str(out), "--with-reference", *pair)[1])
    assert [row["split"] for row in rows] == ["test", "ood"]
    assert json.loads(bench("compare", str(theirs), *pair)[1]) == rows


def test_with_reference_refuses_another_protocol_without_mixed(
    task, smoke, bench, tmp_path, monkeypatch
):
    out, theirs, small = tmp_path / "mine", tmp_path / "theirs", tmp_path / "small"
    study = replace(get_preset("smoke"), methods=("nn",), settings={("nn", "epochs"): 1})
    run(replace(study, controller=ControllerConfig(epochs=6)), theirs, Workers(1))
    bench("run", "smoke", "--jobs", "1", "--out", str(out))
    bench("pack", str(theirs), "--out", str(small))
    monkeypatch.setattr("bench.packed.SHIPPED", small)
    pair = ("--methods", "kodex,nn")
    report, compare = ("report", str(out)), ("compare", str(out), *pair)
    command = f"--tasks door --methods kodex --out {out}-paper\n"
    for words, experiments in ((report, "sizes,success,ood"), (compare, "success,ood")):
        code, said, error = bench(*words, "--with-reference")
        assert (code, said) == (2, "")
        assert error.startswith(f"bench: {out} and the shipped results cannot be compared")
        assert re.search(r"controller epochs +5 +6\n", error)
        assert error.endswith(f"bench run paper --experiments {experiments} {command}")
    code, said, _ = bench(*report, "--with-reference", "--mixed")
    note = f"{out} (controller epochs 5); shipped (controller epochs 6)"
    assert code == 0
    assert "| KODex* |" in said
    assert "An asterisk marks" in (out / "report/tables/success.md").read_text()
    for place in (said, (out / "report/index.html").read_text()):
        assert note in place
    code, said, _ = bench(*compare, "--with-reference", "--mixed")
    assert code == 0
    assert "| kodex* |" in re.sub(" +", " ", said)
    assert note in said
    code, said, error = bench(*compare, "--with-reference", "--mixed", "--json")
    assert {row["left"] for row in json.loads(said)} == {"kodex"}
    assert note in error


def test_report_and_compare_refuse_methods_with_different_settings(task, smoke, bench, tmp_path):
    file, out = tmp_path / "mine.safetensors", str(tmp_path / "results")
    save_demos(load_demos(task)[:5], file)
    options = ("run", "smoke", "--jobs", "1", "--out", out)
    bench(*options, "--demos", str(file))
    bench(*options, "--methods", "nn", "--set", "nn.epochs=1")
    for words in (("report", out), ("compare", out, "--methods", "kodex,nn")):
        code, _, error = bench(*words)
        assert code == 2
        assert error.startswith("bench: kodex and nn cannot be compared on door\n")
        assert re.search(r"demos +3 +6\n +demos of +\w{8} +the expert\n", error)
    assert bench("compare", out, "--methods", "kodex, expert,")[0] == 0
    assert "kodex (demos 3, demos of" in bench("report", out, "--mixed")[1]


def test_with_reference_refuses_when_no_results_are_shipped(
    task, smoke, bench, tmp_path, monkeypatch
):
    monkeypatch.setattr("bench.packed.SHIPPED", tmp_path / "nothing")
    bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
    code, _, error = bench("report", str(tmp_path), "--with-reference")
    assert code == 2
    assert "no reference results are shipped" in error


def test_report_shows_fits_of_several_versions_only_with_mixed(
    task, smoke, bench, tmp_path, monkeypatch
):
    bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
    monkeypatch.setattr("bench.provenance.version", lambda name: "9.9")
    options = ("--methods", "nn", "--set", "nn.epochs=1", "--jobs", "1")
    bench("run", "smoke", *options, "--out", str(tmp_path))
    code, _, error = bench("report", str(tmp_path))
    assert code == 2
    assert "9.9" in error
    assert "give --mixed" in error
    assert bench("report", str(tmp_path), "--mixed")[0] == 0


def test_report_takes_either_a_folder_or_reference(task, smoke, bench, tmp_path):
    for options in ((), (str(tmp_path), "--reference")):
        code, _, error = bench("report", *options)
        assert code == 2
        assert "give a results folder or --reference" in error


def test_the_same_results_give_a_report_with_the_same_bytes(task, smoke, bench, tmp_path, files_of):
    bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
    bench("report", str(tmp_path))
    before = files_of(tmp_path)
    bench("report", str(tmp_path))
    assert files_of(tmp_path) == before


def test_a_report_is_not_written_among_results(task, smoke, bench, tmp_path, files_of):
    bench("run", "smoke", "--methods", "kodex", "--out", str(tmp_path), "--jobs", "1")
    before = files_of(tmp_path)
    code, _, err = bench("report", str(tmp_path), "--out", str(tmp_path))
    assert code == 2
    assert f"holds results: name another folder, such as {tmp_path / 'report'}" in err
    assert files_of(tmp_path) == before
