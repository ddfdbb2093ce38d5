"""Which episodes fail and how: `bench failures`, its data frames and pictures, and motions."""

import json

import numpy as np
import pandas as pd
import pytest

from bench.replay import replay
from bench.results import Results as StoredResults
from reports.exhibits.starts import summary as halves
from reports.exhibits.success_over_time import summary as half_times
from reports.exhibits.success_over_time import table as over_time
from reports.failing import ELSEWHERE, FAILURES, count_modes, draw_failures, failures
from reports.motions import draw_motion, motions
from reports.results import Results
from reports.starts import shown_numbers, start_values
from tasks.base import DIVERGED
from tasks.errors import InputError
from tasks.experts import load_expert
from tasks.recorder import record
from tasks.registry import TASKS, get_task

STARTS = 7


@pytest.fixture
def results(bench, task, smoke, tmp_path):
    """Results of KODex and the expert, in which every third start fails."""
    folder = tmp_path / "results"
    options = ("--experiments", "success,ood", "--episodes", str(STARTS), "--jobs", "1")
    assert bench("run", "smoke", "--tasks", task.name, *options, "--out", str(folder))[0] == 0
    return folder


def row_of(folder, method, split="test"):
    frame = Results(folder).rows.main(method=method, split=split)
    return frame.to_dict("records")[0]


@pytest.mark.parametrize("task", ["relocation"], indirect=True)
def test_a_replay_of_another_seed_has_the_readings_of_the_run(task, bench, smoke, tmp_path):
    run = (
        "run",
        "smoke",
        "--tasks",
        task.name,
        "--experiments",
        "success",
        "--seeds",
        "2,3",
        "--episodes",
        str(STARTS),
    )
    assert bench(*run, "--jobs", "1", "--out", str(tmp_path))[0] == 0
    stored = StoredResults(tmp_path)
    for row in Results(tmp_path).rows.main(split="test").to_dict("records"):
        found = replay(tmp_path, row, [1, 4]).episodes.readings.astype(np.float32)
        np.testing.assert_array_equal(found, stored.readings(row)[[1, 4]])


@pytest.mark.parametrize("task", ["door"], indirect=True)
class TestFailures:
    def test_failures_has_one_row_with_a_mode_for_each_failed_episode(self, task, results):
        found = failures(results, task.name, "kodex")
        stored = StoredResults(results).outcomes(row_of(results, "kodex"))
        assert found.start.tolist() == stored.start[~stored.success].tolist() == [0, 3, 6]
        assert set(found["mode"]) <= {DIVERGED, *task.failure_modes}
        assert set(found.split) == {"test"}
        assert found.steps.tolist() == stored.steps[~stored.success].tolist()
        numbers = [component.name for component in task.start_components]
        np.testing.assert_array_equal(
            found[numbers], task.sample("test", STARTS, 1).values[found.start]
        )

    def test_command_prints_modes_and_the_film_command_and_draws_starts(self, bench, task, results):
        code, out, err = bench("failures", str(results), "--method", "kodex", "--split", "test")
        assert code == 0
        assert "replaying 3 failed episodes: kodex, seed 1" in err
        assert "1:0, 1:3, 1:6" in out
        path = results / "pictures" / f"failures-{task.name}-kodex-test.png"
        assert path.stat().st_size
        assert str(path) in out
        film = f"film: bench video {task.name} --results {results} --methods kodex"
        film += " --seed 1 --start 0"
        assert film in out

    def test_json_lists_all_failing_starts_of_both_splits(self, bench, task, results):
        code, out, _ = bench("failures", str(results), "--json")
        said = json.loads(out)
        assert code == 0
        assert {row["split"] for row in said["modes"]} == {"test", "ood"}
        assert {row["method"] for row in said["modes"]} == {"kodex"}
        starts = [one for row in said["modes"] if row["split"] == "test" for one in row["starts"]]
        assert sorted(starts) == [[1, 0], [1, 3], [1, 6]]
        assert said["pictures"] == [str(results / "pictures" / f"failures-{task.name}.png")]

    def test_failures_of_packed_results_have_no_modes(self, bench, task, results, tmp_path):
        packed = tmp_path / "packed"
        assert bench("pack", str(results), "--out", str(packed))[0] == 0
        found = failures(packed, task.name, "kodex")
        assert found.start.tolist() == [0, 3, 6]
        assert found["mode"].isna().all()
        code, out, _ = bench("failures", str(packed))
        assert code == 0
        assert "packed results hold no fits" in out
        assert "film" not in out
        assert (packed / "pictures" / f"failures-{task.name}.png").stat().st_size


@pytest.mark.parametrize("task", ["door"], indirect=True)
class TestErrors:
    def test_unknown_names_are_refused_with_the_nearest_name(self, bench, results):
        for options, reason in {
            ("--method", "kodx"): "did you mean 'kodex'",
            ("--task", "dor"): "did you mean 'door'",
            ("--task", "tool"): "unknown task with results 'tool'",
            ("--split", "tst"): "did you mean 'test'",
            ("--seed", "9"): "kodex has no results of seed 9 on door; it has 1",
        }.items():
            code, _, err = bench("failures", str(results), *options)
            assert code == 2
            assert reason in err
        assert not (results / "pictures").exists()
        for start in (STARTS, -1):
            with pytest.raises(
                InputError, match=f"start {start} of door/test has no stored episode"
            ):
                motions(results, "door", "kodex", start)


@pytest.mark.parametrize("task", ["tool", "reorientation"], indirect=True)
def test_replay_equals_the_stored_episode(task, results):
    for method in ("kodex", "expert"):
        for split in ("test", "ood"):
            row = row_of(results, method, split)
            seen = replay(results, row, [1, 4, 5]).episodes
            stored = StoredResults(results).outcomes(row).iloc[[1, 4, 5]]
            readings = StoredResults(results).readings(row)[[1, 4, 5]]
            assert seen.steps.tolist() == stored.steps.tolist()
            np.testing.assert_array_equal(seen.readings.astype(np.float32), readings)


@pytest.mark.parametrize("task", ["relocation"], indirect=True)
class TestMotions:
    def test_motions_of_the_expert_equal_its_own_recorded_rollout(self, task, results):
        found = motions(results, task.name, "expert", 4)
        assert found.predicted.isna().all()
        names = [one.name for one in task.components[: task.robot_dim]]
        expert = load_expert(task).policy
        shown = record(task, task.sample("test", 5, 1)[4:], expert, failures=True)[1]
        wide = found.pivot(index="t", columns="joint", values="demonstrated")[names]
        np.testing.assert_array_equal(wide, shown.states[0, :, : task.robot_dim])
        tracked = found.pivot(index="t", columns="joint", values="tracked")[names]
        np.testing.assert_allclose(tracked, wide, atol=1e-6)
        assert set(found.unit) == {"rad", "m"}

    def test_prediction_begins_at_the_start_and_has_the_fits_stored_error(self, task, results):
        found = motions(results, task.name, "kodex", 0)
        first = found[found.t == 0]
        np.testing.assert_allclose(first.predicted, first.demonstrated, atol=1e-9)
        stored = StoredResults(results).diagnostics(row_of(results, "kodex")["folder"])[
            "imitation_error"
        ]
        np.testing.assert_array_equal(first.error, stored)

    def test_figure_has_a_panel_with_a_unit_for_each_joint(self, task, results):
        found = motions(results, task.name, "kodex", 0)
        figure = draw_motion(found, ["ARTx", "WRJ1"])
        assert [axes.get_ylabel() for axes in figure.axes] == ["ARTx [m]", "WRJ1 [rad]"]
        assert len(draw_motion(found).axes) == 3
        with pytest.raises(InputError, match="did you mean 'WRJ1'"):
            draw_motion(found, ["WRJ"])

    def test_report_writes_the_same_bytes_twice(self, bench, results):
        names = ("motions", "starts", "success_over_time")

        def written():
            assert bench("report", str(results))[0] == 0
            files = (results / "report").rglob("*.*")
            return {path.name: path.read_bytes() for path in files if path.stem in names}

        once = written()
        assert {f"{name}.{kind}" for name in names for kind in ("svg", "csv")} <= set(once)
        assert written() == once

    def test_report_whose_motions_all_fail_names_them_and_ends_with_exit_code_3(
        self, bench, results, monkeypatch, tmp_path
    ):
        def refuse(*arguments):
            raise InputError("the fit cannot be loaded")

        monkeypatch.setattr("reports.exhibits.motions.replayed_motion", refuse)
        code, _, error = bench("report", str(results), "--out", str(tmp_path / "report"))
        assert code == 3
        assert "no motion of kodex on relocation: the fit cannot be loaded" in error
        assert "left out: Predicted and tracked motions: InputError: no motion can be" in error
        assert (tmp_path / "report/tables/success.md").exists()

    def test_motions_of_packed_results_are_refused(self, bench, task, results, tmp_path):
        packed = tmp_path / "packed"
        assert bench("pack", str(results), "--out", str(packed))[0] == 0
        with pytest.raises(InputError, match="packed results, without the fits"):
            motions(packed, task.name, "kodex", 0)


@pytest.mark.parametrize("task", ["door", "reorientation"], indirect=True)
def test_success_over_time_ends_at_the_success_rate(bench, task, smoke, tmp_path):
    folder = tmp_path / "results"
    options = ("--experiments", "success", "--episodes", "7", "--jobs", "1")
    assert bench("run", "smoke", "--tasks", task.name, *options, "--out", str(folder))[0] == 0
    curves = over_time(Results(folder))
    for method, curve in curves.groupby("row"):
        assert curve.value.iloc[-1] == pytest.approx(400 / 7), method
        assert curve.t.iloc[-1] == pytest.approx(0.01 * task.steps)


def curve(values):
    times = 0.01 * np.arange(1, len(values) + 1)
    return pd.DataFrame({"row": "nn", "column": "door", "t": times, "value": values})


def test_summary_gives_the_time_at_half_of_the_final_success():
    assert half_times(curve([0.0, 20.0, 40.0, 60.0])).value.tolist() == [0.03]
    assert half_times(curve([0.0, 80.0, 40.0])).value.tolist() == [0.02]
    assert half_times(curve([10.0, 0.0])).value.isna().all()


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("tool", ["nail_height"]),
        ("door", ["door_x", "door_y"]),
        ("relocation", ["target_x", "target_z"]),
        ("reorientation", ["goal_pitch", "goal_yaw"]),
    ],
)
def test_shown_numbers_are_those_that_go_beyond_the_training_range(name, numbers):
    components = get_task(name).start_components
    assert [components[place].name for place in shown_numbers(get_task(name))] == numbers


def test_summary_of_starts_gives_success_in_each_half_of_a_range():
    values = start_values(get_task("tool"), "test", 50, 1)
    share = np.where(values.nail_height > 0.175, 100.0, 0.0)
    table = values.assign(row="nn", column="tool", split="test", value=share)
    found = halves(table).set_index("row").value
    assert found.to_dict() == {"tool nail_height, low half": 0, "tool nail_height, high half": 100}


@pytest.mark.parametrize("name", TASKS)
def test_each_failure_mode_has_its_own_look(name):
    assert len(FAILURES) >= len({DIVERGED, *get_task(name).failure_modes, ELSEWHERE})


def episodes(modes, seed=1, split="test"):
    task = get_task("door")
    values = start_values(task, split, len(modes), seed)
    failed = np.array([mode is not None for mode in modes])
    labels = {"seed": seed, "split": split, "mode": modes, "steps": 69, "success": ~failed}
    return values.assign(**labels)


def test_count_modes_counts_over_seeds_in_the_tasks_order():
    turned, lost = "latch not turned", "hand lost the handle"
    whole = pd.concat([episodes([lost, None, turned]), episodes([lost, None, None], seed=2)])
    counts = count_modes(get_task("door"), whole)
    assert counts["mode"].tolist() == [turned, lost]
    assert counts.failed.tolist() == [1, 2]
    assert counts.starts.tolist() == [[(1, 2)], [(1, 0), (2, 0)]]
    assert counts.share.tolist() == pytest.approx([100 / 6, 200 / 6])


def test_picture_has_a_panel_for_each_method_and_a_marker_for_each_mode():
    by_method = {
        "nn": episodes([None, "latch not turned", DIVERGED]),
        "kodex": episodes([None, None, "opened too little"]),
    }
    figure = draw_failures(get_task("door"), by_method)
    assert [axes.get_title().split(",")[0] for axes in figure.axes] == ["KODex", "NN"]
    (legend,) = figure.legends
    names = [text.get_text() for text in legend.get_texts()]
    assert names == ["success", DIVERGED, "latch not turned", "opened too little"]


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_method_of_a_package_is_replayed_in_a_separate_process(task, results, monkeypatch):
    apart = []

    def spy(job, *arguments):
        apart.append(job.__name__)
        return job(*arguments)

    monkeypatch.setattr("bench.replay.apart", spy)
    here = failures(results, "door", "kodex")
    assert apart == []
    monkeypatch.setattr("bench.replay.SUITE", ())
    assert failures(results, "door", "kodex").equals(here)
    assert len(apart) == 1
