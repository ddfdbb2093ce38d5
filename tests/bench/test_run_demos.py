"""Runs that learn from files of demonstrations, on a small random expert."""

import hashlib
import json
import re
from dataclasses import replace

import pytest

from bench import load
from bench.backend import Workers
from bench.driver import run
from bench.presets import get_preset
from bench.results import Results as StoredResults
from bench.study_demos import learning_from
from reports.exhibits import EXHIBITS
from reports.results import Results
from tasks.demos import demos_key, load_demos
from tasks.demos_files import save_demos

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)


def test_a_run_learns_from_a_file_of_demonstrations(task, smoke, bench, tmp_path):
    file, out = tmp_path / "mine.safetensors", tmp_path / "results"
    save_demos(load_demos(task)[:5], file)
    run = ("run", "smoke", "--jobs", "1", "--out", str(out), "--demos", str(file))
    code, said, _ = bench(*run)
    assert (code, said.split(",")[0]) == (0, "7 results computed")
    frame = StoredResults(out).frame()
    assert set(frame[frame.method == "kodex"].demos) == {3}
    assert set(frame[frame.split == "validation"].episodes) == {2}
    assert bench(*run)[1].startswith("0 results computed")
    plan = json.loads(bench("plan", *run[1:], "--json")[1])
    assert (plan["missing_fits"], plan["missing_evaluations"]) == (0, 0)
    assert bench("verify", str(out), "--jobs", "1", "--cells", "9")[0] == 0
    bench(*run[:-2])
    frame = StoredResults(out).frame()
    assert frame[frame.method == "kodex"].groupby("demos").demos_key.nunique().to_dict() == {
        3: 1,
        6: 1,
    }
    assert frame[frame.method == "kodex"].demos_key.nunique() == 2
    save_demos(load_demos(task)[:6], file)
    bench(*run)
    others = set(StoredResults(out).frame().demos_key) - {demos_key(task)}
    assert len(others) == 2
    labels = {f"kodex:demos={key[:8]}" for key in others}
    assert set(load(out).method) == {"expert", "kodex", *labels}


@pytest.mark.parametrize(
    ("options", "answer"),
    [
        (("smoke", "--tasks", "relocation"), "demonstrations of door, which is not among"),
        (("quick",), "of door, not of tool, relocation, reorientation: give a file for each"),
        (("smoke", "--demos", "FILE"), "both show door: give one of them"),
    ],
)
def test_run_refuses_demonstrations_of_another_task(task, smoke, bench, tmp_path, options, answer):
    file, out = tmp_path / "mine.safetensors", tmp_path / "results"
    save_demos(load_demos(task), file)
    words = [str(file) if word == "FILE" else word for word in options]
    code, _, error = bench("run", *words, "--out", str(out), "--demos", str(file))
    assert code == 2
    assert re.search(answer, error)
    assert not out.exists()


@pytest.mark.parametrize(
    ("harm", "answer"),
    [
        ("flipped", "is damaged: its SHA-256 is not the one in mine.safetensors.sha256"),
        ("no file", "mine.safetensors does not exist"),
        ("a folder", "bench demos import TASK"),
        ("no SHA-256", "lacks its SHA-256, which is written beside it as mine.safe"),
        ("text", "is no file of demonstrations; such a file is in the safetensors format"),
        ("other content", "`bench demos record` makes one"),
    ],
)
def test_run_refuses_a_file_without_valid_demonstrations(
    task, smoke, bench, tmp_path, harm, answer
):
    file, out = tmp_path / "mine.safetensors", tmp_path / "results"
    save_demos(load_demos(task), file)
    data = file.read_bytes()
    if harm == "flipped":
        file.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    elif harm in ("no file", "a folder"):
        file.unlink()
        if harm == "a folder":
            file.mkdir()
    elif harm in ("no SHA-256", "text"):
        file.with_name("mine.safetensors.sha256").unlink()
        file.write_bytes(b"text" if harm == "text" else data)
    else:
        file.write_bytes(b"not safetensors")
        digest = hashlib.sha256(b"not safetensors").hexdigest()
        file.with_name("mine.safetensors.sha256").write_text(digest)
    code, _, error = bench("run", "smoke", "--out", str(out), "--demos", str(file))
    assert code == 2
    assert str(file) in error
    assert answer in error
    assert not out.exists()


def test_report_says_that_the_expert_did_not_record_the_file(task, smoke, bench, tmp_path):
    file, out = tmp_path / "mine.safetensors", tmp_path / "results"
    save_demos(load_demos(task)[:5], file)
    run = ("run", "smoke", "--jobs", "1", "--out", str(out))
    bench(*run, "--demos", str(file), "--experiments", "success")
    note = "learnt from the demonstrations of mine.safetensors. The expert in the tables"
    code, said, _ = bench("report", str(out))
    assert code == 0
    assert note in said
    assert note in (out / "report/index.html").read_text()
    assert "| Expert (suite's own) |" in said
    caption = "On Door, the expert is the suite's own; the methods learnt from other demonst"
    assert caption in (out / "report/tables/success.md").read_text()
    assert caption not in (out / "report/tables/table_6.md").read_text()
    said = bench("compare", str(out), "--methods", "kodex,expert")[1]
    assert "| expert (suite's own) |" in said
    assert note in said


def test_captions_say_which_controllers_did_not_learn_from_the_file(task, smoke, tmp_path):
    file = tmp_path / "mine.safetensors"
    save_demos(load_demos(task)[:5], file)
    study = replace(get_preset("smoke"), tasks=("door",), episodes={"robustness": 3})
    run(learning_from(study, [file]), tmp_path / "results", Workers(1))
    results = Results(tmp_path / "results")
    captions = {
        exhibit.name: exhibit.with_remarks(results).caption(exhibit.table(results))
        for exhibit in EXHIBITS
    }
    remark = "On Door, tuned and unclipped controllers learnt from the suite's expert"
    assert {name for name, caption in captions.items() if remark in caption} == {"table_8"}
