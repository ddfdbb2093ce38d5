import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from bench.controller import ControllerConfig
from bench.controller_kinds import ORIGINAL
from bench.remarks import remarks
from bench.spec import Cell, ControllerSpec, Evaluation, Fit
from bench.store import Store
from tasks.data import Episodes, NonFinite, Starts, generator
from tasks.errors import InputError
from tasks.files import to_bytes

FIT = Fit("door", "kodex", "described", "single", {"observables": 3, "cutoff": 1.0}, 10, 0, "r")
OTHER = Fit("door", "kodex", "described", "single", {"observables": 2, "cutoff": 1.0}, 10, 0, "r")
EVALUATION = Evaluation("door", "test", controller_key="c")
CONTROLLER = ControllerSpec("door", ORIGINAL, ControllerConfig(), 10, "r")
WEIGHTS = {"koopman": np.arange(6.0).reshape(2, 3)}


@pytest.fixture
def store(tmp_path):
    store = Store(tmp_path / "results")
    with store.locked():
        store.ask_for([Cell(FIT, EVALUATION, 4)])
        store.add_fit(FIT, to_bytes(WEIGHTS), to_bytes({"losses": np.ones(3)}), {"seconds": 1.5})
        store.add_episodes(FIT, EVALUATION, some_episodes(0, 4))
        yield store


def some_episodes(first, last):
    rng = generator("episodes")
    readings = rng.standard_normal((last, 69))
    readings[0, 5:] = np.nan
    starts = Starts("door", "test", np.arange(first, last), np.zeros((last - first, 3)))
    success = np.arange(first, last) % 2 == 1
    steps = np.full(last - first, 69)
    diverged = np.zeros(last - first, bool)
    return Episodes(starts, success, diverged, steps, readings[first:])


def test_what_is_stored_comes_back(store):
    assert store.has_fit(FIT)
    assert not store.has_fit(OTHER)
    assert store.parameters(FIT) == to_bytes(WEIGHTS)
    frame = store.episodes(FIT, EVALUATION)
    expected = some_episodes(0, 4)
    np.testing.assert_array_equal(frame.start, expected.starts.index)
    np.testing.assert_array_equal(frame.success, expected.success)
    np.testing.assert_array_equal(frame.steps, expected.steps)
    np.testing.assert_array_equal(np.stack(frame.readings), expected.readings.astype("f4"))


def test_a_controller_comes_back(store):
    assert not store.has_controller(CONTROLLER)
    store.add_controller(CONTROLLER, to_bytes(WEIGHTS), {})
    assert store.has_controller(CONTROLLER)
    assert store.controller_weights(CONTROLLER) == to_bytes(WEIGHTS)


def test_more_episodes_extend_the_same_evaluation(store):
    store.add_episodes(FIT, EVALUATION, some_episodes(2, 6), keep=2)
    path = next(store.cells.glob("*/*.parquet"))
    extended = path.read_bytes()
    assert list(store.episodes(FIT, EVALUATION).start) == [0, 1, 2, 3, 4, 5]
    store.add_episodes(FIT, EVALUATION, some_episodes(0, 6))
    assert path.read_bytes() == extended
    assert store.frame().loc[0, "episodes"] == 6


def test_what_was_not_finite_is_kept_with_the_episodes_and_replaced_with_them(store):
    assert remarks(store) == []
    spoilt = replace(
        some_episodes(0, 4), non_finite=(NonFinite(0, "act", 1, 30), NonFinite(2, "act", 2, 8))
    )
    store.add_episodes(FIT, EVALUATION, spoilt)
    assert [one.split(";")[0] for one in remarks(store)] == [
        "kodex on door, seed 0: act returned NaN or inf for 3 of 4 starts, first at t=8"
    ]
    store.add_episodes(FIT, EVALUATION, some_episodes(2, 6), keep=2)
    ((spec, count, chunks),) = store.non_finite()
    assert (spec["seed"], count, chunks) == (0, 6, [NonFinite(0, "act", 1, 30)])
    store.add_episodes(FIT, EVALUATION, some_episodes(0, 4))
    assert remarks(store) == []


def test_the_frame_counts_what_was_asked_for(store):
    store.add_fit(OTHER, to_bytes(WEIGHTS), b"", {})
    store.add_episodes(OTHER, EVALUATION, some_episodes(0, 2))
    frame = store.frame()
    assert len(frame) == 1
    row = frame.loc[0]
    assert (row.task, row.method, row.split, row.demos) == ("door", "kodex", "test", 10)
    assert (row.episodes, row.successes, row.diverged) == (4, 2, 0)
    assert np.isnan(row.fit_seconds)
    store.add_times(row, [3.0, 1.5, 1.0])
    assert store.frame().loc[0, "fit_seconds"] == 1.5
    # The last to be asked for under a label is what tables show.
    store.ask_for([Cell(OTHER, EVALUATION, 2)])
    assert store.frame().loc[0, "episodes"] == 2


def test_the_frame_names_its_columns_before_there_is_a_row(store, tmp_path):
    columns = list(store.frame().columns)
    assert set(columns) >= {*asdict(FIT), *asdict(EVALUATION), "episodes", "folder"}
    empty = Store(tmp_path / "empty")
    with empty.locked():
        empty.ask_for([])
    assert list(empty.frame().columns) == columns


def test_episodes_of_another_controller_count_as_missing(store):
    assert store.episodes(FIT, Evaluation("door", "test", controller_key="d")) is None
    assert not (store.folder / "damaged").exists()


def damage_flip(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def damage_truncate(path):
    path.write_bytes(path.read_bytes()[:-7])


def damage_empty(path):
    path.write_bytes(b"")


@pytest.mark.parametrize("damage", [damage_flip, damage_truncate, damage_empty])
@pytest.mark.parametrize(
    "name", ["fit.json", "weights.safetensors", "diagnostics.safetensors", "eval-*.parquet"]
)
def test_damage_is_seen_and_set_aside(store, damage, name, capsys):
    damage(next(store.cells.glob(f"*/{name}")))
    if name.startswith("eval"):
        assert store.episodes(FIT, EVALUATION) is None
        assert store.has_fit(FIT)
    else:
        assert not store.has_fit(FIT)
    assert "set aside as" in capsys.readouterr().err
    assert len(list((store.folder / "damaged").iterdir())) == 1
    assert store.frame().empty


def test_files_of_another_cell_are_seen(store, capsys):
    store.add_fit(OTHER, to_bytes(WEIGHTS), b"", {})
    store.add_episodes(OTHER, EVALUATION, some_episodes(0, 4))
    paths = sorted(store.cells.glob("*/eval-*.parquet"))
    here, there = (path.read_bytes() for path in paths)
    paths[0].write_bytes(there)
    paths[1].write_bytes(here)
    assert store.episodes(FIT, EVALUATION) is None
    assert store.episodes(OTHER, EVALUATION) is None
    folders = sorted(store.cells.iterdir())
    folders[0].rename(folders[0].with_name("aside"))
    folders[1].rename(folders[0])
    folders[0].with_name("aside").rename(folders[1])
    assert not store.has_fit(FIT)
    assert not store.has_fit(OTHER)


def test_episodes_of_another_evaluation_of_the_same_fit_are_set_aside(store, capsys):
    other = Evaluation("door", "ood", controller_key="c")
    store.add_episodes(FIT, other, some_episodes(0, 4))
    test, ood = (next(store.cells.glob(f"*/eval-{split}-*")) for split in ("test", "ood"))
    ood.write_bytes(test.read_bytes())
    assert store.episodes(FIT, other) is None
    assert "set aside as" in capsys.readouterr().err
    assert store.episodes(FIT, EVALUATION) is not None


def test_a_second_writer_is_refused(store):
    with pytest.raises(InputError, match="another run is writing"), Store(store.folder).locked():
        pass


def test_what_an_interrupted_writer_left_is_cleared_away(tmp_path):
    store = Store(tmp_path)
    left = tmp_path / ".unfinished" / "cell"
    left.mkdir(parents=True)
    with store.locked():
        assert not left.exists()


def test_a_damaged_study_is_refused_with_a_way_out(store):
    (store.folder / "study.json").write_text(json.dumps([]))
    with pytest.raises(InputError, match="remove it and run the study again"):
        store.frame()


def test_a_folder_without_results_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no results"):
        Store(tmp_path / "nothing").frame()
