from dataclasses import asdict, replace

import numpy as np
import pytest

from bench.remarks import remarks
from bench.results import Results
from bench.results_writer import writing
from bench.spec import Evaluation
from bench.stored_files import Times
from tasks.data import NonFinite
from tasks.errors import InputError


def test_a_stored_fit_and_its_episodes_are_read_as_written(stored):
    results = stored.results
    assert results.has_fit(stored.fit)
    assert not results.has_fit(stored.other)
    assert results.parameters(stored.fit) == stored.weights
    frame, expected = results.episodes(stored.wanted), stored.episodes(0, 4).episodes
    np.testing.assert_array_equal(frame.start, expected.starts.index)
    np.testing.assert_array_equal(frame.success, expected.success)
    np.testing.assert_array_equal(frame.steps, expected.steps)
    np.testing.assert_array_equal(np.stack(frame.readings), expected.readings.astype("f4"))


def test_a_row_of_the_frame_leads_to_outcomes_readings_diagnostics_and_facts(stored):
    results, expected = stored.results, stored.episodes(0, 4).episodes
    (row,) = results.frame().to_dict("records")
    assert list(results.outcomes(row).success) == list(expected.success)
    np.testing.assert_array_equal(results.readings(row), expected.readings.astype("f4"))
    assert list(results.diagnostics(row["folder"])["losses"]) == [1, 1, 1]
    assert results.facts(row["folder"]) == {"seconds": 1.5}


def test_a_stored_controller_is_read_as_written(stored):
    assert not stored.results.has_controller(stored.controller)
    with pytest.raises(InputError, match="lacks the controller"):
        stored.results.controller_spec(stored.controller.key)
    stored.writer.add_controller(stored.controller, stored.weights, {})
    results = stored.results
    assert results.has_controller(stored.controller)
    assert results.controller_weights(stored.controller) == stored.weights
    assert results.controller_spec(stored.controller.key)["demos"] == 10


def test_open_results_show_later_writes(stored):
    results = stored.results
    assert not results.has_fit(stored.other)
    other = stored.cell(stored.other, stored.evaluation).wanted
    assert results.stored_episodes(other) == 0
    stored.writer.add_fit(stored.other, stored.weights, b"", {})
    stored.writer.add_episodes(stored.other, stored.evaluation, stored.episodes(0, 2))
    assert results.stored_episodes(other) == 2
    stored.writer.add_episodes(stored.other, stored.evaluation, stored.episodes(2, 6), keep=2)
    assert results.stored_episodes(other) == 6


def test_the_frame_shows_the_last_requested_evaluations(stored):
    stored.writer.add_fit(stored.other, stored.weights, b"", {})
    stored.writer.add_episodes(stored.other, stored.evaluation, stored.episodes(0, 2))
    frame = stored.results.frame()
    assert len(frame) == 1
    row = frame.loc[0]
    assert (row.task, row.method, row.split, row.demos) == ("door", "kodex", "test", 10)
    assert (row.episodes, row.successes, row.diverged) == (4, 2, 0)
    stored.writer.ask_for([stored.cell(stored.other, stored.evaluation, 2).wanted])
    assert stored.results.frame().loc[0, "episodes"] == 2


def test_the_frame_has_the_median_of_measured_times(stored):
    row = stored.results.frame().loc[0]
    assert np.isnan(row.fit_seconds)
    stored.writer.add_times(row.folder, Times([3.0, 1.5, 1.0], [0.2, 0.1, 0.3]))
    row = stored.results.frame().loc[0]
    assert (row.fit_seconds, row.action_seconds) == (1.5, 0.2)


def test_an_empty_frame_has_all_columns(stored, tmp_path):
    columns = list(stored.results.frame().columns)
    assert {*asdict(stored.fit), *asdict(stored.evaluation), "episodes"} <= {*columns}
    with writing(tmp_path / "empty") as writer:
        writer.ask_for([])
    assert list(Results(tmp_path / "empty").frame().columns) == columns


def test_episodes_of_another_controller_count_as_missing_not_as_damaged(stored):
    other = Evaluation("door", "test", controller_key="d")
    wanted = stored.cell(stored.fit, other).wanted
    results = stored.results
    assert (results.stored_episodes(wanted), results.episodes(wanted)) == (0, None)
    assert results.damaged == {}


@pytest.mark.parametrize(
    "name", ["fit.json", "weights.safetensors", "diagnostics.safetensors", "eval-*.parquet"]
)
def test_damage_is_reported_once_counts_as_missing_and_stays_in_place(stored, damage, name, capsys):
    path = stored.path(f"cells/*/{name}")
    damage(path)
    results = stored.results
    for _ in range(2):
        assert results.stored_episodes(stored.wanted) == 0
        assert results.episodes(stored.wanted) is None
        assert results.frame().empty
    assert results.has_fit(stored.fit) == name.startswith("eval")
    harmed = path if name.startswith("eval") else path.parent
    assert list(results.damaged) == [harmed]
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith(f"{harmed} is damaged (")
    assert said.endswith("); the next `bench run` sets it aside\n")
    assert path.exists()


def test_damage_between_two_reads_is_detected(stored, damage):
    results = stored.results
    (row,) = results.frame().to_dict("records")
    damage(stored.path("cells/*/eval-*.parquet"))
    damage(stored.path("cells/*/weights.safetensors"))
    assert results.stored_episodes(stored.wanted) == 0
    assert not results.has_fit(stored.fit)
    for read in (
        lambda: results.outcomes(row),
        lambda: results.parameters(stored.fit),
        lambda: results.diagnostics(row["folder"]),
    ):
        with pytest.raises(InputError, match="run the study again"):
            read()


def test_damaged_times_and_failures_count_as_missing(stored, damage, capsys):
    folder = stored.results.frame().loc[0, "folder"]
    stored.writer.add_times(folder, Times([1.0]))
    stored.writer.add_failure("one", "reason", "traceback")
    for pattern in ("cells/*/times.json", "failures/*.json"):
        damage(stored.path(pattern))
    results = stored.results
    assert np.isnan(results.frame().loc[0, "fit_seconds"])
    assert results.failures() == []
    assert len(results.damaged) == capsys.readouterr().err.count("is damaged") == 2


def test_files_of_another_cell_count_as_damaged(stored):
    stored.writer.add_fit(stored.other, stored.weights, b"", {})
    stored.writer.add_episodes(stored.other, stored.evaluation, stored.episodes(0, 4))
    other = stored.cell(stored.other, stored.evaluation).wanted
    paths = sorted(stored.writer.folder.glob("cells/*/eval-*.parquet"))
    here, there = (path.read_bytes() for path in paths)
    paths[0].write_bytes(there)
    paths[1].write_bytes(here)
    results = stored.results
    assert results.stored_episodes(stored.wanted) == results.stored_episodes(other) == 0
    assert sorted(results.damaged) == paths
    folders = [path.parent for path in paths]
    folders[0].rename(folders[0].with_name("aside"))
    folders[1].rename(folders[0])
    folders[0].with_name("aside").rename(folders[1])
    results = stored.results
    assert not results.has_fit(stored.fit)
    assert not results.has_fit(stored.other)
    assert sorted(results.damaged) == folders


def test_episodes_of_another_evaluation_of_the_same_fit_count_as_damaged(stored):
    ood = Evaluation("door", "ood", controller_key="c")
    stored.writer.add_episodes(stored.fit, ood, stored.episodes(0, 4))
    path = stored.path("cells/*/eval-ood-*")
    path.write_bytes(stored.path("cells/*/eval-test-*").read_bytes())
    results = stored.results
    assert results.stored_episodes(stored.cell(stored.fit, ood).wanted) == 0
    assert results.stored_episodes(stored.wanted) == 4
    assert list(results.damaged) == [path]


def test_non_finite_answers_are_stored_with_their_episodes(stored):
    assert remarks(stored.results) == []
    made = stored.episodes(0, 4)
    wrong = (NonFinite(0, "act", 1, 30), NonFinite(2, "act", 2, 8))
    spoilt = replace(made, episodes=replace(made.episodes, non_finite=wrong))
    stored.writer.add_episodes(stored.fit, stored.evaluation, spoilt)
    assert [one.split(";")[0] for one in remarks(stored.results)] == [
        "kodex on door, seed 1: act returned NaN or inf for 3 of 4 starts, first at t=8"
    ]
    assert len(remarks(stored.results, ["kodex"])) == 1
    assert remarks(stored.results, ["nn"]) == []
    stored.writer.add_episodes(stored.fit, stored.evaluation, stored.episodes(2, 6), keep=2)
    ((spec, count, chunks),) = stored.results.non_finite()
    assert (spec["seed"], count, chunks) == (1, 6, [NonFinite(0, "act", 1, 30)])
    stored.writer.add_episodes(stored.fit, stored.evaluation, stored.episodes(0, 4))
    assert remarks(stored.results) == []


def test_a_folder_without_results_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no results"):
        Results(tmp_path / "nothing").frame()
