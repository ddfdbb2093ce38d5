import json
import subprocess
import sys
from itertools import pairwise

import pytest

from bench.experiments import EXPERIMENTS
from bench.presets import PRESETS
from bench.store import Store
from reports.write import Report
from tasks.masses import physics_names
from tasks.registry import TASKS, get_task


def test_list_names_the_four_tasks(bench):
    code, out, _ = bench("list", "--json")
    assert code == 0
    names = json.loads(out)
    assert names["tasks"] == list(TASKS)
    assert "kodex" in names["methods"]
    assert names["experiments"] == list(EXPERIMENTS)
    assert names["presets"] == ["smoke", "quick", "paper"]
    code, out, _ = bench("list")
    assert code == 0
    assert "tool, door, relocation, reorientation" in out


@pytest.mark.parametrize(
    ("library", "importer", "command", "extra"),
    [
        ("minari", "tasks.minari", ("demos", "export", "door", "set"), "data"),
        ("stable_baselines3", "tasks.training", ("expert", "train", "door"), "expert"),
    ],
)
def test_an_extra_that_is_missing_is_named(
    bench, monkeypatch, tmp_path, library, importer, command, extra
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.delitem(sys.modules, importer, raising=False)
    code, out, error = bench(*command)
    assert (code, out) == (2, "")
    assert f"pip install -e '.[{extra}]'" in error


def test_describe_gives_the_facts_of_a_task(bench, task):
    code, out, _ = bench("describe", task.name, "--json")
    facts = json.loads(out)
    assert code == 0
    assert facts["name"] == task.name
    assert facts["robot_dim"] == task.layout.robot_dim
    assert facts["object_dim"] == task.layout.object_dim
    assert facts["horizon"] == task.horizon
    assert len(facts["components"]) == task.layout.state_dim
    assert set(facts["components"][0]) == {"name", "unit", "source"}
    assert len({component["name"] for component in facts["components"]}) == task.layout.state_dim
    assert len(facts["model_hash"]) == 64
    assert list(facts["splits"]) == ["train", "demo", "probe", "test", "ood"]
    assert tuple(facts["physics"]) == physics_names(task.name)


def test_describe_can_be_read_by_a_person(bench, task):
    code, out, _ = bench("describe", task.name)
    assert code == 0
    for expected in ("state x = [x_r, x_o]", task.rule, task.model_hash, "heavy_hand", "THJ0"):
        assert expected in out


def test_describe_gives_the_sizes_and_variants_of_a_method(bench):
    code, out, _ = bench("describe", "nn", "--json")
    facts = json.loads(out)
    assert code == 0
    assert list(facts["sizes"]) == ["small", "median", "large"]
    assert facts["sizes"]["small"]["hidden"] == [32, 64, 32]
    # Table 2, for the 35 states of Door: weights and biases, and the scaling of states.
    widths = (35, 32, 64, 32, 35)
    count = sum((a + 1) * b for a, b in pairwise(widths)) + 2 * 35
    assert facts["parameters"]["small"]["door"] == count
    assert facts["variants"]["published"]["fresh_adam"] == "batch"
    assert "published" in bench("describe", "nn")[1]


def test_describe_gives_the_experiments_of_a_preset(bench):
    code, out, _ = bench("describe", "paper", "--json")
    facts = json.loads(out)
    assert code == 0
    assert facts["episodes"] == PRESETS["paper"].episodes
    assert facts["seeds"] == [1, 2, 3, 4, 5]
    assert facts["evaluations"] > facts["fits"] > 500
    assert "bench plan paper" in bench("describe", "paper")[1]


def test_an_unknown_name_ends_with_the_nearest_name_and_exit_code_2(bench):
    code, out, err = bench("describe", "relocate")
    assert (code, out) == (2, "")
    assert "unknown name 'relocate'" in err
    assert "did you mean 'relocation'" in err


def test_models_are_told_apart_by_their_hash():
    assert len({get_task(name).model_hash for name in TASKS}) == len(TASKS)


def test_listing_needs_no_simulator():
    code = (
        "import sys; from bench.cli import list_names; list_names();"
        " sys.exit(any(name in sys.modules for name in ('mujoco', 'torch', 'pandas', 'scipy')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_tasks_register_no_environments():
    code = (
        "import sys; from tasks.registry import get_task; get_task('door').model;"
        " sys.exit('gymnasium' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_doctor_says_what_there_is_and_what_is_missing(bench, tmp_path, monkeypatch):
    monkeypatch.setenv("BENCH_CACHE", str(tmp_path))
    code, out, _ = bench("doctor", str(tmp_path / "not" / "there"), "--json")
    found = {row["what"]: row for row in json.loads(out)}
    assert code == 0
    assert found["cache"]["found"] == str(tmp_path)
    for task in ("tool", "door", "relocation", "reorientation"):
        assert found[task]["found"] == "expert shipped, demonstrations not made yet"
    assert f"disk at {tmp_path}" in found


def test_status_of_nothing_is_refused(bench, tmp_path):
    code, _, error = bench("status", str(tmp_path / "nothing"))
    assert code == 2
    assert "holds no results" in error


@pytest.mark.parametrize(
    ("command", "options", "answer"),
    [
        ("report", (), "no evaluations to show yet"),
        ("report", ("--with-reference",), "no evaluations to show yet"),
        ("compare", ("--methods", "kodex,nn"), "no evaluations to show yet"),
        ("verify", ("--jobs", "1"), "no evaluations to verify yet"),
    ],
)
def test_what_has_no_evaluation_yet_is_refused(bench, tmp_path, command, options, answer):
    Store(tmp_path).ask_for([])
    code, said, error = bench(command, str(tmp_path), *options)
    assert (code, said) == (2, "")
    assert answer in error


def test_nothing_is_timed_where_there_is_no_evaluation_yet(bench, tmp_path):
    Store(tmp_path).ask_for([])
    code, said, _ = bench("time", str(tmp_path))
    assert (code, said) == (0, f"0 fits timed in {tmp_path}\n")


OUTPUTS = {
    "run": ("run", "smoke", "--out", "OUT"),
    "plan": ("plan", "smoke", "--out", "OUT"),
    "merge": ("merge", "RESULTS", "--out", "OUT"),
    "pack": ("pack", "RESULTS", "--out", "OUT"),
    "report": ("report", "RESULTS", "--out", "OUT"),
    "report --export": ("report", "RESULTS", "--out", "RESULTS/report", "--export", "OUT/file"),
    "report beside": ("report", "OUT"),
    "export": ("demos", "export", "door", "OUT"),
    "import": ("demos", "import", "door", "RESULTS", "--out", "OUT/file"),
    "new-method": ("new-method", "mine", "--folder", "OUT"),
    "expert train": ("expert", "train", "door", "--folder", "OUT"),
    "video": ("video", "door", "--results", "RESULTS", "--methods", "kodex", "--out", "OUT"),
}


@pytest.mark.parametrize("where", ["file", "below a file", "/proc/out"])
@pytest.mark.parametrize("command", OUTPUTS.values(), ids=OUTPUTS)
def test_what_cannot_be_written_to_is_refused_before_any_work(
    bench, tmp_path, monkeypatch, command, where
):
    monkeypatch.setattr("bench.renderer.renderer", lambda: "egl")
    monkeypatch.setattr("bench.driver._Runner", pytest.fail)
    monkeypatch.setattr("tasks.demos.load_demos", pytest.fail)
    (tmp_path / "file").write_text("mine")
    out = {"file": tmp_path / "file", "below a file": tmp_path / "file" / "out"}.get(where, where)
    results = tmp_path / "results"
    results.mkdir()
    Store(results).ask_for([])
    before = sorted(tmp_path.rglob("*"))
    words = [w.replace("OUT", str(out)).replace("RESULTS", str(results)) for w in command]
    code, said, error = bench(*words)
    assert (code, said) == (2, "")
    assert str(out) in error
    assert sorted(tmp_path.rglob("*")) == before
    assert (tmp_path / "file").read_text() == "mine"


def test_doctor_says_what_cannot_be_written_to(bench, tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("BENCH_CACHE", str(tmp_path / "file"))
    found = json.loads(bench("doctor", str(tmp_path / "file"), "--json")[1])
    advice = {row["what"]: row["advice"] for row in found}
    assert "is no folder; set BENCH_CACHE" in advice["cache"]
    assert "is no folder; choose another place" in advice[f"disk at {tmp_path}/file"]


def test_an_export_that_fails_leaves_the_file_that_was_there(bench, tmp_path, monkeypatch):
    def fail(self, path, **options):
        path.write_text("half")
        raise OSError(28, "No space left on device")

    (tmp_path / "file").write_text("old")
    monkeypatch.setattr("pandas.DataFrame.to_parquet", fail)
    monkeypatch.setattr("reports.write.write_report", lambda *arguments: Report([], []))
    with pytest.raises(OSError, match="No space left"):
        bench(
            "report",
            "--reference",
            "--out",
            str(tmp_path / "r"),
            "--export",
            str(tmp_path / "file"),
        )
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "old"
