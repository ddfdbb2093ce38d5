"""Results, demonstrations and runs from Python."""

import sys
from functools import partial
from importlib.metadata import EntryPoint
from types import ModuleType

import numpy as np
import pandas as pd
import pytest

import bench as suite
from bench import views
from bench.presets import get_preset
from bench.spec import Fit
from bench.studies import study_of
from bench.training_data import training_demos, validation_demos
from methods.base import MotionMethod
from tasks.demos import adopt_demos, load_demos
from tasks.demos_files import save_demos
from tasks.errors import InputError

OPTIONS = ("--jobs", "1", "--episodes", "3", "--set", "nn.epochs=1")
RUN = ("run", "smoke", "--methods", "kodex,nn", *OPTIONS)


@pytest.fixture
def door(task, smoke):
    return task


pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)


def test_open_gives_tables_and_fitted_methods(door, bench, tmp_path):
    bench(*RUN, "--seeds", "2,3", "--out", str(tmp_path))
    found = suite.open(tmp_path)
    assert {"kodex", "nn"} == set(found.frame.method)
    assert len(found.episodes) == found.frame.episodes.sum()
    assert "numbers mean nothing" in found.notes[0]
    assert sorted(found.methods("door")) == ["kodex", "nn"]

    _, validation = suite.demos("door")
    states = validation.states
    predicted = {
        seed: found.methods("door", seed=seed)["nn"].rollout(states[:, 0], 5)
        for seed in (None, 2, 3)
    }
    assert predicted[None].shape[:2] == (2, 6)
    np.testing.assert_array_equal(predicted[None], predicted[2])
    assert not np.array_equal(predicted[2], predicted[3])
    assert isinstance(found.methods("door", seed=3, size="single")["kodex"], MotionMethod)

    for call, answer in (
        (lambda: found.methods("tool"), "unknown task of these results 'tool': choose from door"),
        (lambda: found.methods("door")["lstm"], "unknown method of these results 'lstm'"),
        (lambda: found.methods("door", seed=9)["nn"], r"seed of nn .* 9: choose from 2, 3"),
        (lambda: found.methods("door", size="huge")["nn"], "size of nn in these results 'huge'"),
    ):
        with pytest.raises(InputError, match=answer):
            call()


def test_a_fit_of_another_version_is_not_loaded(door, bench, tmp_path, monkeypatch):
    bench("run", "smoke", "--jobs", "1", "--episodes", "2", "--out", str(tmp_path))
    monkeypatch.setattr("methods.kodex.Kodex.version", 99)
    with pytest.raises(InputError, match="fitted by another version of kodex"):
        suite.open(tmp_path).methods("door")["kodex"]


def test_fits_of_several_settings_have_names_of_their_own(door, bench, tmp_path):
    bench(*RUN, "--set", "nn.batch_size=16,64", "--seeds", "1", "--out", str(tmp_path))
    found = suite.open(tmp_path).methods("door")
    kodex, *others = sorted(found)
    assert kodex == "kodex"
    assert [f"batch_size={found[name].config.batch_size}" in name for name in others] == [True] * 2


def test_a_fit_is_loaded_after_an_update_of_mujoco(door, bench, tmp_path, monkeypatch):
    """Its key is as before; its label then says whose demonstrations it learnt from."""
    bench("run", "smoke", "--jobs", "1", "--episodes", "2", "--out", str(tmp_path))
    monkeypatch.setattr("mujoco.__version__", "99.0")
    assert isinstance(suite.open(tmp_path).methods("door")["kodex"], MotionMethod)


def test_packed_results_open_with_tables_but_no_fits(door, bench, tmp_path):
    mine, small = tmp_path / "mine", tmp_path / "small"
    bench(*RUN, "--out", str(mine))
    bench("pack", str(mine), "--out", str(small))
    pd.testing.assert_frame_equal(suite.load(small), suite.load(mine))
    with pytest.raises(InputError, match=r"packed results, without fits: open .*`bench run`"):
        suite.open(small).methods("door")


def test_open_without_a_folder_gives_the_shipped_results(task):
    found = suite.open()
    assert set(found.frame.task) == {"tool", "door", "relocation", "reorientation"}
    assert len(found.episodes) == found.frame.episodes.sum()


@pytest.mark.parametrize("opener", [suite.open, suite.load])
def test_a_folder_without_results_is_named(task, tmp_path, opener):
    with pytest.raises(InputError, match=f"{tmp_path / 'nothing'} does not exist"):
        opener(tmp_path / "nothing")
    with pytest.raises(InputError, match="holds no results"):
        opener(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("given", [3, "", b"results"])
@pytest.mark.parametrize(
    "call", [suite.open, suite.load, partial(suite.run, "smoke")], ids=["open", "load", "run"]
)
def test_values_that_are_no_paths_are_refused(task, tmp_path, monkeypatch, call, given):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=f"folder must be a path.*, got {given!r}"):
        call(given)


@pytest.fixture
def looks(monkeypatch):
    """A package that provides the three views, which return their arguments."""
    module = ModuleType("looks")
    module.failures = lambda folder, task, method, split, seed: (task, method, split, seed)
    module.motions = lambda folder, task, method, start, seed: (task, method, start, seed)
    module.draw_motion = lambda frame, joints: (*frame, joints)
    monkeypatch.setitem(sys.modules, "looks", module)
    names = ("failures", "motions", "draw_motion")
    points = [EntryPoint(name, f"looks:{name}", views.ENTRY_POINTS) for name in names]
    monkeypatch.setattr(views, "entry_points_of", lambda group: points)
    return points


def test_failures_and_motions_come_from_the_views_of_packages(task, looks):
    found = suite.open()
    assert found.failures("door", "kodex") == ("door", "kodex", "test", None)
    assert found.failures("door", "nn", "ood", seed=2) == ("door", "nn", "ood", 2)
    drawn = found.plot_motion("door", "kodex", start=17, joints=["ARRx", "WRJ1"])
    assert drawn == ("door", "kodex", 17, None, ["ARRx", "WRJ1"])


def test_the_suites_own_views_show_failures_and_motions(door, bench, tmp_path):
    pytest.importorskip("reports.motions")
    bench("run", "smoke", "--jobs", "1", "--episodes", "4", "--out", str(tmp_path))
    found = suite.open(tmp_path)
    assert found.failures("door", "kodex").start.tolist() == [0, 3]
    figure = found.plot_motion("door", "kodex", start=1, joints=["ARRx", "WRJ1"])
    assert [axes.get_ylabel() for axes in figure.axes] == ["ARRx [rad]", "WRJ1 [rad]"]


@pytest.mark.parametrize(
    ("harm", "answer"),
    [
        ("missing", "no installed package provides the view 'failures'"),
        ("twice", "provide the same view 'failures'"),
        ("broken", r"view 'failures' of .* cannot be imported: ModuleNotFoundError"),
    ],
)
def test_an_unusable_view_is_named(task, looks, harm, answer):
    if harm == "twice":
        looks.append(looks[0])
    else:
        looks.pop(0)
    if harm == "broken":
        looks.append(EntryPoint("failures", "nowhere:failures", views.ENTRY_POINTS))
    with pytest.raises(InputError, match=answer):
        suite.open().failures("door", "kodex")


def test_demos_returns_those_of_the_cache_or_of_a_file(door, tmp_path):
    made = load_demos(door)
    training, validation = suite.demos("door")
    np.testing.assert_array_equal(training.states, made.states[:6])
    np.testing.assert_array_equal(validation.actions, made.actions[6:])
    save_demos(made[:5], tmp_path / "mine.safetensors")
    assert [*map(len, suite.demos("door", tmp_path / "mine.safetensors"))] == [3, 2]
    with pytest.raises(InputError, match="did you mean 'door'"):
        suite.demos("doors")


def test_demos_of_a_file_are_those_that_a_run_learns_from(door, tmp_path):
    path = tmp_path / "mine.safetensors"
    save_demos(load_demos(door)[:5], path)
    fit = Fit("door", "kodex", "described", "single", {}, 3, 2, adopt_demos(door, path))
    training, validation = suite.demos("door", path, seed=2)
    np.testing.assert_array_equal(training.states, training_demos(fit).states)
    np.testing.assert_array_equal(validation.states, validation_demos(fit).states)


def test_a_run_takes_the_options_of_the_command_line(door, tmp_path):
    save_demos(load_demos(door)[:5], tmp_path / "mine.safetensors")
    outcome = suite.run(
        "smoke",
        tmp_path / "results",
        jobs=1,
        backend="sequential",
        experiments=["success"],
        methods=["nn"],
        tasks="door",
        seeds=[2],
        episodes=2,
        demos=tmp_path / "mine.safetensors",
        settings={"nn.epochs": 1, "nn.hidden": (8,)},
    )
    assert outcome.failed == ()
    (row,) = suite.open(tmp_path / "results").frame.query("method == 'nn'").to_dict("records")
    assert (row["seed"], row["demos"], row["episodes"]) == (2, 3, 2)
    assert row["config"]["hidden"] == [8]


@pytest.mark.parametrize("seed", [0, 1.5, None, "first"])
def test_a_seed_of_demonstrations_is_a_whole_number_from_1(task, seed):
    with pytest.raises(InputError, match="a seed must be a whole number from 1"):
        suite.demos("door", seed=seed)


def test_a_study_that_is_neither_a_name_nor_a_study_is_refused(task):
    with pytest.raises(InputError, match="name of a preset or a Study, got None"):
        study_of(None)


def test_options_mean_the_same_as_text_and_as_values(task):
    as_texts = study_of(
        "quick", tasks="tool,door", seeds="3", episodes=10_000, settings=["nn.epochs=5"]
    )
    as_values = study_of(
        get_preset("quick"),
        tasks=["tool", "door"],
        seeds=3,
        episodes=1e4,
        settings={"nn.epochs": 5},
    )
    assert as_texts == as_values
    assert as_texts.seeds == (1, 2, 3)
    assert study_of("quick", seeds=np.int64(3)).seeds == (1, 2, 3)
    assert study_of("quick", seeds=[7]).seeds == (7,)
    assert study_of("quick", seeds=range(1, 3), methods=None).seeds == (1, 2)


@pytest.mark.parametrize(
    ("options", "answer"),
    [
        ({"method": ["nn"]}, "unknown option of a study 'method': .* did you mean 'methods'"),
        ({"methods": ["mm"]}, "unknown method 'mm'"),
        ({"episodes": 0}, "episodes must be a whole number from 1"),
        ({"seeds": []}, "takes a number of seeds"),
        ({"settings": {"epochs": 5}}, r"takes METHOD.FIELD=VALUE, .* got 'epochs'"),
        ({"demos": "nothing"}, "nothing does not exist"),
        ({"demos": []}, "demonstrations of no task, not of door"),
        ({"demos": 3}, "demos are a file or a list of files, got 3"),
        ({"demos": [3]}, "must be a path"),
        ({"tasks": 5}, "unknown task '5'"),
        ({"seeds": 2.5}, "got 2.5"),
        ({"settings": {3: 4}}, "takes METHOD.FIELD=VALUE, .* got '3'"),
        ({"weights": {3: "x.safetensors"}}, "unknown method of the run '3'"),
        ({"settings": ["nn.epochs=5", "nn.epochs = 6"]}, r"gives nn.epochs twice: .*nn.epochs=1,2"),
    ],
)
def test_an_unusable_option_is_refused(task, options, answer):
    with pytest.raises(InputError, match=answer):
        study_of("smoke", **options)


def test_one_size_of_each_method_is_the_one_that_validates_best(door):
    results = suite.open()
    several = results.episodes.query(
        "split == 'test' and physics == 'nominal' and variant == 'described'"
        " and disturbance == 'none' and replan == 0 and seed == 1 and task == 'door'"
        " and (demos == 200 or method == 'expert')"
    )
    assert set(several[several.method == "nn"]["size"]) == {"median", "large"}
    one = results.at_best_size(several)
    sizes = one.groupby("method", observed=True)["size"].unique().map(list)
    assert sizes[["kodex", "nn", "ndp"]].tolist() == [["single"], ["large"], ["large"]]
    assert one.groupby("method", observed=True).size().nunique() <= 2
    median = several[several["size"] == "median"]
    assert results.at_best_size(median).equals(median)
    assert results.at_best_size(several[:0]).empty
