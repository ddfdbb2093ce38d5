import json
import re
import subprocess
import sys
from dataclasses import replace
from importlib.metadata import version
from itertools import pairwise, product
from pathlib import Path

import pytest
import typer

from bench.cli import app
from bench.experiments import EXPERIMENTS, cells_of
from bench.presets import PRESETS
from bench.results_writer import ResultsWriter
from bench.study_demos import demos_keys_of
from reports.exhibits import EXHIBITS
from reports.write import Report
from tasks.experts import load_expert
from tasks.masses import VARIATIONS
from tasks.registry import TASKS, get_task


def test_list_names_the_four_tasks(bench):
    code, out, _ = bench("list", "--json")
    assert code == 0
    names = json.loads(out)
    assert names["tasks"] == list(TASKS)
    assert "kodex" in names["methods"]
    assert names["experiments"] == list(EXPERIMENTS)
    assert names["presets"] == ["smoke", "quick", "paper", "audit", "beyond"]
    code, out, _ = bench("list")
    assert code == 0
    assert "tool, door, relocation, reorientation" in out


@pytest.mark.parametrize(
    ("library", "importer", "command", "extra"),
    [
        ("minari", "tasks.minari", ("demos", "export", "door", "set"), "data"),
        ("stable_baselines3", "tasks.expert_training", ("expert", "train", "door"), "expert"),
    ],
)
def test_a_missing_extra_is_named(bench, monkeypatch, tmp_path, library, importer, command, extra):
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
    assert tuple(facts["physics"]) == task.physics


def test_describe_prints_readable_text(bench, task):
    code, out, _ = bench("describe", task.name)
    assert code == 0
    # Names are not cut on a narrow terminal.
    for expected in ("state x = [x_r, x_o]", task.rule, task.model_hash, "THJ0", *task.physics):
        assert expected in out


def test_describe_says_how_good_each_expert_of_a_task_is(bench):
    facts = json.loads(bench("describe", "door", "--json")[1])
    card = load_expert(get_task("door")).card
    first, second = facts["experts"]
    assert (first["name"], first["seed"], second["name"]) == ("first", card["seed"], "second")
    assert first["probe"] == card["success"]["probe"]["successes"] / card["episodes"]
    assert (first["tracked"], first["faults"]) == (card["imitation"]["tracked"], card["faults"])
    row = re.search(r"first .*", bench("describe", "door")[1])[0]
    assert f"{100 * card['imitation']['kodex']:.1f}" in row
    assert ("missed" in row) == bool(card["faults"])


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
    assert facts["seeds"] == list(range(1, 11))
    assert "repeats the whole study" in facts["seed"]
    assert facts["evaluations"] > facts["fits"] > 500
    assert "bench plan paper" in bench("describe", "paper")[1]


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_describe_gives_the_measure_and_counts_of_an_experiment(bench, name):
    code, out, _ = bench("describe", name, "--json")
    facts = json.loads(out)
    assert (code, facts["kind"], facts["name"]) == (0, "experiment", name)
    assert facts["measures"]
    assert facts["varies"]
    for preset, study in PRESETS.items():
        alone = replace(study, episodes={n: k for n, k in study.episodes.items() if n == name})
        cells = cells_of(alone, demos_keys_of(alone)) if alone.episodes else []
        counts = facts["presets"][preset]
        assert (counts is None) == (name not in study.episodes)
        if counts:
            assert counts["episodes"] == study.episodes[name]
            assert counts["evaluations"] == len(cells)
            assert counts["episodes_in_all"] == sum(cell.episodes for cell in cells)
            assert {cell.evaluation.split for cell in cells} <= set(facts["splits"])
            assert {cell.evaluation.physics for cell in cells} <= set(facts["physics"])
            assert {cell.evaluation.controller for cell in cells} <= set(facts["controllers"])
    said = bench("describe", name)[1]
    presets = [preset for preset, counts in facts["presets"].items() if counts]
    for expected in (facts["measures"], facts["varies"], *presets, *facts["splits"]):
        assert expected in said


def test_describe_gives_the_conditions_of_robustness(bench):
    facts = json.loads(bench("describe", "robustness", "--json")[1])
    assert list(facts["splits"]) == ["test"]
    assert facts["physics"] == ["nominal", *VARIATIONS]
    assert set(facts["controllers"]) == {"none", "original", "tuned"}
    assert facts["exhibits"]["paper"] == ["table_7", "table_8", "table_9", "table_10"]
    assert (facts["presets"]["smoke"], facts["presets"]["paper"]["episodes"]) == (None, 200)


def test_an_experiment_says_what_its_disturbances_mean(bench):
    for name in ("disturbed", "closed_loop"):
        said = bench("describe", name)[1]
        assert "joints_off_0.05" in said
        assert "each hinge of the hand" in said
    assert "joints_off" not in bench("describe", "success")[1]


def test_every_exhibit_belongs_to_an_experiment(bench):
    facts = [json.loads(bench("describe", name, "--json")[1]) for name in EXPERIMENTS]
    named = {e for one in facts for names in one["exhibits"].values() for e in names}
    assert named == {exhibit.name for exhibit in EXHIBITS}


def test_an_unknown_name_ends_with_the_nearest_name_and_exit_code_2(bench):
    code, out, err = bench("describe", "relocate")
    assert (code, out) == (2, "")
    assert "unknown name 'relocate'" in err
    assert "did you mean 'relocation'" in err
    for kind in ("tasks: tool", "methods: kodex", "experiments: sizes", "presets: smoke"):
        assert kind in err


def test_every_task_has_its_own_model_hash():
    assert len({get_task(name).model_hash for name in TASKS}) == len(TASKS)


def test_list_does_not_import_the_simulator():
    code = (
        "import sys; from bench.cli import cli_describe; cli_describe.list_names();"
        " sys.exit(any(name in sys.modules for name in ('mujoco', 'torch', 'pandas', 'scipy')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_tasks_do_not_import_gymnasium():
    code = (
        "import sys; from tasks.registry import get_task; get_task('door').model;"
        " sys.exit('gymnasium' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_doctor_reports_what_is_present_and_missing(bench, tmp_path, monkeypatch):
    monkeypatch.setenv("BENCH_CACHE", str(tmp_path))
    code, out, _ = bench("doctor", str(tmp_path / "not" / "there"), "--json")
    found = {row["what"]: row for row in json.loads(out)}
    assert code == 0
    assert found["cache"]["found"] == str(tmp_path)
    for task in ("tool", "door", "relocation", "reorientation"):
        assert found[task]["found"] == "experts shipped, demonstrations not made yet"
    assert f"disk at {tmp_path}" in found


READERS = {
    "status": ("status", "DIR"),
    "time": ("time", "DIR"),
    "merge": ("merge", "DIR", "--out", "OUT"),
    "pack": ("pack", "DIR", "--out", "OUT"),
    "submit": ("submit", "DIR", "--out", "OUT"),
    "report": ("report", "DIR"),
    "compare": ("compare", "DIR", "--methods", "kodex,nn"),
    "failures": ("failures", "DIR"),
    "verify": ("verify", "DIR"),
    "video": ("video", "door", "--results", "DIR", "--methods", "kodex"),
}


@pytest.mark.parametrize(
    ("what", "answer"),
    [
        ("nothing", "does not exist: name a results folder"),
        ("file", "is not a folder: name a results folder"),
        ("folder", "holds no results: `bench run` writes them"),
    ],
)
@pytest.mark.parametrize("command", READERS.values(), ids=READERS)
def test_a_folder_without_results_is_refused_and_not_created(
    bench, tmp_path, monkeypatch, command, what, answer
):
    monkeypatch.setattr("bench.renderer.renderer", lambda: "egl")
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    before = sorted(tmp_path.rglob("*"))
    places = {"DIR": str(tmp_path / what), "OUT": str(tmp_path / "out")}
    if (command[0], what) == ("verify", "file"):
        answer = "is damaged (its content is not what was written): name a file of `bench submit`"
    code, said, error = bench(*(places.get(word, word) for word in command))
    assert (code, said) == (2, "")
    assert f"{tmp_path / what} {answer}" in error
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("command", ["status", "time", "merge", "submit", "video"])
def test_packed_results_are_refused_where_fits_are_needed(bench, tmp_path, monkeypatch, command):
    (tmp_path / "evaluations.parquet").touch()
    places = {"DIR": str(tmp_path), "OUT": str(tmp_path / "out")}
    code, _, error = bench(*(places.get(word, word) for word in READERS[command]))
    assert code == 2
    assert "holds results of `bench pack`" in error


def every_command():
    """Returns the words of every command and group."""
    found, left = [], [((), typer.main.get_command(app))]
    while left:
        words, command = left.pop()
        found.append(words)
        left += [((*words, name), one) for name, one in getattr(command, "commands", {}).items()]
    return sorted(found)


@pytest.mark.parametrize("words", every_command(), ids=" ".join)
def test_every_command_prints_help_with_h(bench, words):
    code, said, error = bench(*words, "-h")
    assert (code, error) == (0, "")
    assert said == bench(*words, "--help")[1]


@pytest.mark.parametrize("words", every_command(), ids=" ".join)
def test_every_option_and_argument_has_help(words):
    command = typer.main.get_command(app)
    for word in words:
        command = command.commands[word]
    assert [param.name for param in command.params if not getattr(param, "help", "")] == []


def test_the_version_is_that_of_the_package(bench):
    assert bench("--version") == (0, f"kodex-bench {version('kodex-bench')}\n", "")


@pytest.mark.parametrize(
    ("command", "options", "answer"),
    [
        ("report", (), "no evaluations to show yet"),
        ("report", ("--with-reference",), "no evaluations to show yet"),
        ("compare", ("--methods", "kodex,nn"), "no evaluations to show yet"),
        ("verify", ("--jobs", "1"), "no evaluations to verify yet"),
    ],
)
def test_commands_refuse_results_without_evaluations(bench, tmp_path, command, options, answer):
    ResultsWriter(tmp_path).ask_for([])
    code, said, error = bench(command, str(tmp_path), *options)
    assert (code, said) == (2, "")
    assert answer in error


def test_time_measures_nothing_without_evaluations(bench, tmp_path):
    ResultsWriter(tmp_path).ask_for([])
    code, said, _ = bench("time", str(tmp_path))
    assert (code, said) == (0, f"0 fits timed in {tmp_path}\n")


def test_status_prints_the_number_of_tries(bench, tmp_path):
    store = ResultsWriter(tmp_path)
    store.ask_for([])
    for said in ("failed (1 try): door-nn-s1: why", "failed (2 tries): door-nn-s1: why"):
        store.add_failure("door-nn-s1", "why", "")
        assert said in bench("status", str(tmp_path))[1]


OUTPUTS = {
    "run": ("run", "smoke", "--out", "OUT"),
    "plan": ("plan", "smoke", "--out", "OUT"),
    "merge": ("merge", "RESULTS", "--out", "OUT"),
    "pack": ("pack", "RESULTS", "--out", "OUT"),
    "submit": ("submit", "RESULTS", "--out", "OUT/file"),
    "report": ("report", "RESULTS", "--out", "OUT"),
    "report --export": ("report", "RESULTS", "--out", "RESULTS/report", "--export", "OUT/file"),
    "report beside": ("report", "OUT"),
    "export": ("demos", "export", "door", "OUT"),
    "import": ("demos", "import", "door", "RESULTS", "--out", "OUT/file"),
    "new-method": ("new-method", "mine", "--folder", "OUT"),
    "expert train": ("expert", "train", "door", "--folder", "OUT"),
    "video": ("video", "door", "--results", "RESULTS", "--methods", "kodex", "--out", "OUT"),
    "failures": ("failures", "RESULTS", "--out", "OUT"),
}


@pytest.mark.parametrize("where", ["file", "below a file", "/proc/out"])
@pytest.mark.parametrize("command", OUTPUTS.values(), ids=OUTPUTS)
def test_unwritable_folders_are_refused_before_any_work(
    bench, tmp_path, monkeypatch, command, where
):
    monkeypatch.setattr("bench.renderer.renderer", lambda: "egl")
    monkeypatch.setattr("bench.driver.Runner", pytest.fail)
    monkeypatch.setattr("tasks.demos.load_demos", pytest.fail)
    (tmp_path / "file").write_text("mine")
    out = {"file": tmp_path / "file", "below a file": tmp_path / "file" / "out"}.get(where, where)
    results = tmp_path / "results"
    results.mkdir()
    ResultsWriter(results).ask_for([])
    before = sorted(tmp_path.rglob("*"))
    words = [w.replace("OUT", str(out)).replace("RESULTS", str(results)) for w in command]
    code, said, error = bench(*words)
    assert (code, said) == (2, "")
    assert str(out) in error
    assert sorted(tmp_path.rglob("*")) == before
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("run", "smoke", "--out", ""), "--out"),
        (("run", "smoke", "--out="), "--out"),
        (("report", "--reference", "--export", ""), "--export"),
        (("new-method", "mine", "--folder", ""), "--folder"),
        (("status", ""), "status"),
    ],
    ids=" ".join,
)
def test_an_empty_path_is_refused_and_is_not_the_current_folder(
    bench, tmp_path, monkeypatch, words, named
):
    monkeypatch.chdir(tmp_path)
    code, out, error = bench(*words)
    assert (code, out) == (2, "")
    assert error.startswith(f"bench: the text after {named} is empty")
    assert list(tmp_path.iterdir()) == []


def test_doctor_reports_unwritable_folders(bench, tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("BENCH_CACHE", str(tmp_path / "file"))
    found = json.loads(bench("doctor", str(tmp_path / "file"), "--json")[1])
    advice = {row["what"]: row["advice"] for row in found}
    assert "is no folder; set BENCH_CACHE" in advice["cache"]
    assert "is no folder; choose another place" in advice[f"disk at {tmp_path}/file"]


def test_a_failed_export_keeps_the_existing_file(bench, tmp_path, monkeypatch):
    def fail(self, path, **options):
        path.write_text("half")
        raise OSError(28, "No space left on device")

    (tmp_path / "file").write_text("old")
    monkeypatch.setattr("pandas.DataFrame.to_parquet", fail)
    monkeypatch.setattr(
        "reports.write.write_report", lambda *arguments: Report([], {}, [], Path("index.html"))
    )
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


def test_report_of_the_shipped_results_prints_full_paths(bench, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = Report([], {}, [], Path("report/index.html"))
    monkeypatch.setattr("reports.write.write_report", lambda *arguments: made)
    code, said, _ = bench("report", "--reference")
    assert code == 0
    assert f"wrote 0 tables to {tmp_path / 'report'}\n" in said
    assert f"page: {tmp_path / 'report/index.html'}\n" in said


def test_the_shipped_results_can_be_compared(bench):
    code, out, err = bench("compare", "--reference", "--methods", "kodex,nn", "--json")
    assert code == 0
    assert err.startswith("The first expert of each task taught these methods.")
    assert {(row["task"], row["split"]) for row in json.loads(out)} == set(
        product(TASKS, ("test", "ood"))
    )


def test_compare_takes_a_folder_or_the_shipped_results(bench, tmp_path):
    for arguments in ([], [str(tmp_path), "--reference"]):
        code, _, err = bench("compare", *arguments, "--methods", "kodex,nn")
        assert code == 2
        assert "give a results folder or --reference" in err


def test_video_chooses_a_renderer_before_mujoco_is_imported(tmp_path):
    words = ["bench", "video", "door", "--results", str(tmp_path), "--methods", "nn"]
    code = (
        f"import sys; from bench.cli import main; sys.argv = {words}\n"
        "try: main()\nexcept SystemExit: print('mujoco' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "False\n"
    assert "holds no results" in found.stderr
