"""`bench expert` and `bench demos`, on a small random expert whose every third episode fails."""

import json
from functools import partial
from itertools import product

import numpy as np
import pytest
from statsmodels.stats.proportion import proportion_confint

from bench.controller import ControllerConfig
from tasks.demos import demos_path

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)


def test_evaluate_gives_the_success_rate_with_its_interval(task, shipped, bench):
    code, out, _ = bench("expert", "evaluate", "door", "--episodes", "30", "--json")
    result = json.loads(out)
    low, high = proportion_confint(20, 30, method="wilson")
    assert code == 0
    assert result.pop("low") == pytest.approx(low)
    assert result.pop("high") == pytest.approx(high)
    assert result == {
        "task": "door",
        "expert": "first",
        "split": "probe",
        "physics": "nominal",
        "episodes": 30,
        "successes": 20,
        "success_rate": pytest.approx(2 / 3),
        "diverged": 0,
    }


def test_evaluate_prints_readable_text(task, shipped, bench):
    options = ("--episodes", "3", "--split", "ood", "--physics", "heavy_hand")
    code, out, _ = bench("expert", "evaluate", "door", *options)
    assert code == 0
    assert "door/ood, first expert, physics heavy_hand: 2 of 3 episodes successful" in out
    assert "66.7% [20.8%, 93.9%]" in out


@pytest.mark.parametrize(
    ("option", "value", "answer"),
    [
        ("--split", "odd", "did you mean 'ood'"),
        ("--physics", "heavy", "heavy_object"),
        ("--episodes", "0", "Invalid value for '--episodes'"),
    ],
)
def test_evaluate_refuses_invalid_values(task, shipped, bench, option, value, answer):
    code, out, err = bench("expert", "evaluate", "door", option, value)
    assert (code, out) == (2, "")
    assert answer in err


@pytest.mark.parametrize(("command", "option"), [("train", "--threads"), ("probe", "--episodes")])
def test_train_and_probe_refuse_counts_of_zero(task, shipped, bench, tmp_path, command, option):
    folder = tmp_path / "training"
    place = ("--folder", str(folder)) if command == "train" else ()
    code, out, err = bench("expert", command, "door", *place, option, "0")
    assert (code, out) == (2, "")
    assert f"Invalid value for '{option}'" in err
    assert not folder.exists()


@pytest.mark.parametrize(
    ("physics", "motions", "controllers"),
    [
        ("heavy_hand", ("nominal", "heavy_hand"), ("original", "tuned")),
        ("nominal", ("nominal",), ("original",)),
    ],
)
def test_track_gives_the_success_of_each_controller(
    task, shipped, bench, monkeypatch, physics, motions, controllers
):
    monkeypatch.setattr("bench.controller.ControllerConfig", partial(ControllerConfig, epochs=1))
    code, out, _ = bench("expert", "track", "door", physics, "--episodes", "6", "--seeds", "2")
    assert code == 0
    rows = [(row["seed"], row["motions"], row["controller"]) for row in json.loads(out)]
    assert rows == [*product((1, 2), motions, controllers)]
    # Two of six episodes fail, whatever is done.
    assert {(row["success"], row["episodes"]) for row in json.loads(out)} == {(4 / 6, 6)}


def test_track_refuses_unknown_physics(task, shipped, bench):
    code, out, err = bench("expert", "track", "door", "heavy_hands")
    assert (code, out) == (2, "")
    assert "did you mean 'heavy_hand'" in err


def test_demonstrations_are_made_exported_and_imported(task, shipped, bench, tmp_path):
    code, out, _ = bench("demos", "make", "door")
    assert code == 0
    assert f"door: 6 + 2 demonstrations in {demos_path(task)}" in out

    folder, file = tmp_path / "set", tmp_path / "door.safetensors"
    assert bench("demos", "export", "door", str(folder))[0] == 0
    code, out, _ = bench("demos", "import", "door", str(folder), "--out", str(file))
    assert code == 0
    assert "door: 5 of 8 episodes successful on replay" in out
    assert "episodes that fail: 0, 3, 6" in out
    assert file.exists()

    code, out, _ = bench("demos", "verify", "door", str(folder))
    assert code == 3
    assert "5 of 8" in out


def test_demos_make_records_nothing_if_a_name_is_wrong(task, shipped, bench):
    code, _, err = bench("demos", "make", "door", "relocate")
    assert code == 2
    assert "did you mean 'relocation'" in err
    assert not demos_path(task).exists()


@pytest.mark.parametrize(
    "command",
    [
        ("demos", "import", "door", "DIR", "--out", "OUT"),
        ("demos", "verify", "door", "DIR"),
    ],
)
def test_a_folder_that_does_not_exist_is_named(task, shipped, bench, tmp_path, command):
    places = {"DIR": str(tmp_path / "nothing"), "OUT": str(tmp_path / "out")}
    code, _, err = bench(*(places.get(word, word) for word in command))
    assert code == 2
    assert str(tmp_path / "nothing") in err
    assert "does not exist" in err


def test_an_import_does_not_replace_a_file(task, shipped, bench, tmp_path):
    file = tmp_path / "door.safetensors"
    file.write_text("mine")
    code, _, err = bench("demos", "import", "door", str(tmp_path / "set"), "--out", str(file))
    assert code == 2
    assert f"{file} exists" in err
    assert file.read_text() == "mine"


def test_an_export_to_an_existing_folder_records_nothing(task, shipped, bench, tmp_path):
    code, _, err = bench("demos", "export", "door", str(tmp_path))
    assert code == 2
    assert f"{tmp_path} exists already" in err
    assert not demos_path(task).exists()


def test_train_refuses_an_unwritable_folder(task, shipped, bench, tmp_path):
    (tmp_path / "cache").touch()
    code, _, err = bench("expert", "train", "door")
    assert code == 2
    assert f"{tmp_path}/cache is no folder; set BENCH_CACHE" in err
    code, _, err = bench("expert", "train", "door", "--folder", str(tmp_path / "cache" / "door"))
    assert code == 2
    assert f"{tmp_path}/cache is no folder; choose another place" in err


def test_an_import_without_a_success_writes_nothing(task, shipped, bench, tmp_path, monkeypatch):
    folder, file = tmp_path / "set", tmp_path / "door.safetensors"
    assert bench("demos", "export", "door", str(folder))[0] == 0
    monkeypatch.setattr(type(task), "success", lambda self, r: np.zeros(len(r), bool))
    code, out, err = bench("demos", "import", "door", str(folder), "--out", str(file))
    assert code == 2
    assert "0 of 8 episodes successful" in out
    assert f"no episode succeeds on replay, so nothing is written to {file}" in err
    assert not file.exists()


def test_an_import_refuses_a_folder_without_a_data_set(task, shipped, bench, tmp_path):
    file = tmp_path / "door.safetensors"
    code, _, err = bench("demos", "import", "door", str(tmp_path), "--out", str(file))
    assert code == 2
    assert "not a Minari data set" in err
    assert not file.exists()
