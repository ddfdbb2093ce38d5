"""Runs that evaluate weights of files instead of training methods, on a small random expert."""

import json
import re
from dataclasses import replace

import pytest

import bench as suite
from bench.results import Results
from bench.spec import Fit
from methods.contract import resolved
from methods.nn import NN
from methods.registry import get_method
from tasks.data import key
from tasks.files import from_bytes, labels_of, to_bytes
from tasks.pins import mark

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)
RUN = ("run", "smoke", "--jobs", "1", "--experiments", "success", "--seeds", "2")


@pytest.fixture
def trained(task, smoke, bench, tmp_path):
    """Returns a folder in which a method was trained, and a file with its weights of seed 1."""

    def train(name):
        folder, file = tmp_path / "trained", tmp_path / f"{name}.safetensors"
        assert bench(*RUN, "--methods", name, "--out", str(folder))[0] == 0
        suite.save_weights(suite.open(folder).methods("door", seed=1)[name], file)
        return folder, file

    return train


def never(*arguments):
    raise AssertionError("a method was trained")


@pytest.mark.parametrize("name", ["nn", "bc"])
def test_given_weights_are_evaluated_and_nothing_is_trained(
    trained, bench, tmp_path, monkeypatch, name
):
    folder, file = trained(name)
    monkeypatch.setattr("bench.jobs.fit_methods", never)
    run = (*RUN, "--methods", name, "--out", str(tmp_path / "given"))
    plan = ("plan", "smoke", *RUN[4:], *run[8:], "--weights", f"{name}={file}", "--json")
    planned = json.loads(bench(*plan)[1])
    assert (planned["missing_fits"], planned["missing_evaluations"]) == (0, 2)
    assert bench(*run, "--weights", f"{name}={file}")[0] == 0
    before, after = (Results(place) for place in (folder, tmp_path / "given"))
    theirs, mine = (results.frame().set_index("seed") for results in (before, after))
    assert list(mine.index) == [1, 2]
    seed_1 = [results.outcomes(rows.loc[1]) for results, rows in ((before, theirs), (after, mine))]
    assert seed_1[0].equals(seed_1[1])
    weights = [path.read_bytes() for path in after.folder.glob("cells/*/weights.safetensors")]
    assert len(weights) == 2
    assert from_bytes(weights[0]).keys() == from_bytes(file.read_bytes()).keys()
    assert weights[0] == weights[1]
    moved = file.rename(tmp_path / "moved.safetensors")
    assert bench(*run, "--weights", f"{name}@door={moved}")[1].startswith("0 results computed")
    assert bench("verify", str(after.folder), "--jobs", "1")[0] == 0
    assert bench("time", str(after.folder))[1].startswith("0 fits timed")


def test_row_and_note_say_that_weights_are_from_a_file(trained, bench):
    folder, file = trained("nn")
    run = (*RUN, "--methods", "nn", "--out", str(folder), "--weights", f"nn={file}")
    assert bench(*run)[0] == 0
    assert set(suite.load(folder).method) == {"nn", "nn:weights_from_file"}
    assert bench("report", str(folder))[0] == 0
    rows = (folder / "report/tables/success.md").read_text()
    assert "| NN weights from file |" in rows
    assert "| NN  " in rows
    note = "On door, nn has weights from a file, nn.safetensors ("
    assert note in (folder / "report/index.html").read_text()


def test_rows_of_two_files_have_names_of_their_own(trained, bench, tmp_path):
    folder, file = trained("nn")
    second = tmp_path / "second.safetensors"
    suite.save_weights(suite.open(folder).methods("door", seed=2)["nn"], second)
    for one in (file, second):
        bench(*RUN, "--methods", "nn", "--out", str(tmp_path / "out"), "--weights", f"nn={one}")
    labels = set(suite.load(tmp_path / "out").method)
    assert len(labels) == 2
    assert all(label.startswith("nn:weights_from_file=") for label in labels)


def test_a_study_in_python_takes_weights(trained, tmp_path):
    _, file = trained("nn")
    for given in ({"nn": file}, {"nn@door": str(file)}, [f"nn={file}"]):
        options = {"methods": "nn", "experiments": "success", "jobs": 1, "weights": given}
        assert suite.run("smoke", tmp_path / "out", **options).failed == ()
    assert len(list(tmp_path.glob("out/cells/door-nn-weights=*"))) == 1


@pytest.mark.parametrize(
    ("options", "answer"),
    [
        (("nn=FILE", "--methods", "kodex"), "unknown method of the run 'nn'"),
        (
            ("kodex=FILE", "--methods", "kodex"),
            "holds weights of another method than kodex on door",
        ),
        (("nn=FILE", "--set", "nn.epochs=3"), "another config than nn on door: epochs=2, not epo"),
        (("nn=FILE", "--sizes", "large"), "another config than nn on door: hidden=.*, not hidden"),
        (("nn=FILE", "--weights", "nn@door=FILE"), "--weights gives nn on door twice"),
        (("nn=FILE", "--tasks", "door,tool"), "give nn@TASK=FILE for each, or choose with --tasks"),
        (("nn@door=FILE", "--tasks", "door,tool"), "gives no file for nn on tool: give one for ea"),
        (("nn@tool=FILE",), "unknown task of the run 'tool'"),
        (
            ("nn=FILE", "--experiments", "sizes", "--sizes", "small,large"),
            "sizes compares 2 fits of nn on door, but --weights gives one: leave out that experim",
        ),
        (("nn",), "--weights takes METHOD=FILE or METHOD@TASK=FILE, got 'nn'"),
        (("nn=",), "--weights takes METHOD=FILE"),
        (("nn=nowhere",), "nowhere cannot be read: No such file"),
    ],
)
def test_weights_of_another_fit_are_refused_before_anything_is_written(
    task, smoke, bench, tmp_path, weights_of_nn, options, answer
):
    words = [word.replace("FILE", str(weights_of_nn)) for word in options]
    chosen = ("--methods", "nn") if "--methods" not in words else ()
    experiments = ("--experiments", "success") if "--experiments" not in words else ()
    out = tmp_path / "out"
    run = ("run", "smoke", "--out", str(out), *chosen, *experiments, "--weights", *words)
    code, _, error = bench(*run)
    assert code == 2
    assert re.search(answer, error), error
    assert not out.exists()


@pytest.fixture
def weights_of_nn(tmp_path, task, smoke):
    """A file with weights of NN, trained in Python as the preset ``smoke`` trains it."""
    nn = NN(replace(NN.sizes["small"], epochs=2), task.layout)
    nn.fit(*suite.demos("door"), 1)
    suite.save_weights(nn, tmp_path / "nn.safetensors")
    return tmp_path / "nn.safetensors"


def test_weights_that_the_method_cannot_use_are_refused_before_anything_is_evaluated(
    bench, tmp_path, weights_of_nn
):
    content = weights_of_nn.read_bytes()
    narrower = {name: array[..., :-1] for name, array in from_bytes(content).items()}
    weights_of_nn.write_bytes(to_bytes(narrower, **labels_of(content)))
    out = tmp_path / "out"
    run = (*RUN, "--methods", "nn", "--out", str(out), "--weights", f"nn={weights_of_nn}")
    code, _, error = bench(*run)
    assert code == 2
    assert "the weights of door-nn-weights=" in error
    assert "cannot be used: nn on door, seed 1: rollout raised" in error
    assert not list(out.glob("cells/*/*"))


def test_weights_leave_the_keys_of_trained_fits_as_they_were(task):
    config = resolved(NN.sizes["small"])
    fit = Fit("door", "nn", "described", "small", config, 10, 1, "key")
    values = {
        "task": "door",
        "method": "nn",
        "variant": "described",
        "config": config,
        "demos": 10,
        "seed": 1,
        "demos_key": "key",
        "held_out": 0,
        "pins": mark(),
    }
    assert fit.key == key("fit", get_method("nn").version, values)
    given = Fit("door", "nn", "described", "small", config, 10, 1, "key", weights="3f2a91c0")
    assert given.key == key("fit", get_method("nn").version, values | {"weights": "3f2a91c0"})


def test_try_evaluates_given_weights_beside_the_shipped_methods(
    bench, reference, weights_of_nn, monkeypatch
):
    reference()
    monkeypatch.setattr("bench.jobs.fit_methods", never)
    options = ("--set", "nn.epochs=2", "--set", "nn.hidden=32,64,32", "--episodes", "7")
    code, said, _ = bench("try", "nn", *options, "--weights", f"nn={weights_of_nn}")
    assert code == 0
    assert " on door · weights from a file · seed 1 · first 7 starts of test" in said
    assert "\n  nn, weights from a file  " in said
    assert "same controller and starts." in said
    assert "--method nn:weights_from_file" in said
