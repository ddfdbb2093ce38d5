"""Running a study and resuming it, on a small random expert."""

from dataclasses import replace

import pytest

from bench.backend import Workers
from bench.computing import fit_methods
from bench.controller import VERSION, ControllerConfig
from bench.costs import fit_cost
from bench.driver import run
from bench.job_queue import JobQueue
from bench.presets import get_preset
from bench.results import Results as StoredResults
from methods.nn import NN
from tasks.errors import InputError
from tasks.masses import READINGS, VARIATIONS

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)


def test_a_run_stores_all_its_results_and_a_second_run_computes_nothing(
    task, smoke, bench, tmp_path, files_of
):
    out = tmp_path / "results"
    code, said, _ = bench("run", "smoke", "--out", str(out), "--jobs", "1")
    # One controller, one fit, KODex on three splits and the expert on two.
    assert (code, said) == (0, f"7 results computed, 5 cells in {out}\n")
    frame = StoredResults(out).frame().set_index(["method", "split"])
    assert dict(frame.episodes) == {
        ("expert", "ood"): 20,
        ("expert", "test"): 20,
        ("kodex", "ood"): 20,
        ("kodex", "test"): 20,
        ("kodex", "validation"): 2,
    }
    before = files_of(out)
    code, said, _ = bench("run", "smoke", "--out", str(out), "--jobs", "1")
    assert (code, said) == (0, f"0 results computed, 5 cells in {out}\n")
    assert files_of(out) == before


def test_a_run_with_more_episodes_extends_stored_evaluations(
    task, smoke, tmp_path, monkeypatch, files_of
):
    monkeypatch.setattr(type(task), "success", lambda self, r: (1e6 * r[:, -1]) % 2 < 1)
    study = replace(get_preset("smoke"), episodes={"success": 503})
    run(study, tmp_path / "grown", Workers(1, "sequential"))
    larger = replace(study, episodes={"success": 510})
    assert run(larger, tmp_path / "grown", Workers(1, "sequential")).done == 2
    run(larger, tmp_path / "at once", Workers(1, "sequential"))
    assert files_of(tmp_path / "grown") == files_of(tmp_path / "at once")


def test_a_run_computes_a_damaged_fit_and_its_evaluations_again(
    task, smoke, tmp_path, capsys, files_of
):
    study = get_preset("smoke")
    run(study, tmp_path, Workers(1, "sequential"))
    before = files_of(tmp_path)
    path = next(tmp_path.glob("cells/door-kodex*/weights.safetensors"))
    path.write_bytes(path.read_bytes()[:-1])
    # The fit and all three evaluations of it.
    assert run(study, tmp_path, Workers(1, "sequential")).done == 4
    assert files_of(tmp_path) == before
    assert "set aside" in capsys.readouterr().err


def test_a_run_refuses_a_folder_with_results_of_another_controller(task, smoke, tmp_path, files_of):
    study = get_preset("smoke")
    run(study, tmp_path, Workers(1, "sequential"))
    before, asked = files_of(tmp_path), StoredResults(tmp_path).manifest()
    for other, answer in (
        (replace(study, controller=ControllerConfig(epochs=6)), "another controller .its conf"),
        (
            replace(study, controller=ControllerConfig(epochs=6), episodes={"ood": 1}),
            "eval-ood",
        ),
    ):
        with pytest.raises(InputError, match=answer) as refusal:
            run(other, tmp_path, Workers(1, "sequential"))
        assert "of door-kodex-described-single-n6-s1 with" in str(refusal.value)
        assert "choose another folder" in str(refusal.value)
    assert files_of(tmp_path) == before
    assert StoredResults(tmp_path).manifest() == asked


def test_a_run_recomputes_results_of_another_controller_version(
    task, smoke, tmp_path, monkeypatch, capsys
):
    study = get_preset("smoke")
    run(study, tmp_path, Workers(1, "sequential"))
    before = {path.read_bytes() for path in tmp_path.glob("cells/door-kodex*/eval-*")}
    monkeypatch.setattr("bench.controller.VERSION", VERSION + 1)
    # The controller, and all three evaluations that it has a part in.
    assert run(study, tmp_path, Workers(1, "sequential")).done == 4
    assert capsys.readouterr().err.count("set aside as") == 3
    assert {path.read_bytes() for path in (tmp_path / "damaged").iterdir()} == before
    assert run(study, tmp_path, Workers(1, "sequential")).done == 0


def test_other_settings_make_new_cells(task, smoke, bench, tmp_path):
    out = ("--out", str(tmp_path), "--jobs", "1")
    bench("run", "smoke", *out)
    assert bench("run", "smoke", *out, "--set", "kodex.observables=1")[1].startswith("4 results")
    frame = StoredResults(tmp_path).frame()
    configs = frame[frame.split == "validation"].set_index("settings").config
    assert {name: config["observables"] for name, config in configs.items()} == {
        "": 3,
        "observables=1": 1,
    }


def test_a_run_starts_the_longest_job_first(task, smoke, tmp_path, monkeypatch):
    begun = []

    def noted(fits, demos, validation):
        begun.append(fit_cost(fits).seconds)
        return fit_methods(fits, demos, validation)

    monkeypatch.setattr("bench.jobs.fit_methods", noted)
    study = replace(get_preset("smoke"), methods=("kodex", "ndp", "nn"), episodes={"success": 5})
    run(study, tmp_path, Workers(1, "sequential"))
    assert begun == sorted(begun, reverse=True)
    assert len(begun) == 3


def test_other_experiments_evaluate_the_size_that_the_comparison_chooses(
    task, smoke, tmp_path, monkeypatch
):
    default, other = NN.default_size["door"], "small"
    assert other != default
    monkeypatch.setattr("bench.agenda.chosen_sizes", lambda study, frame: {("door", "nn"): other})
    study = replace(
        get_preset("smoke"),
        methods=("nn",),
        sizes=(other, default),
        settings={("nn", "epochs"): 1},
        episodes={"sizes": 2, "success": 3},
    )
    run(study, tmp_path, Workers(1, "sequential"))
    frame = StoredResults(tmp_path).frame().query("method == 'nn'")
    assert set(frame[frame.split == "validation"]["size"]) == {other, default}
    assert set(frame[frame.split == "test"]["size"]) == {other}
    assert run(study, tmp_path, Workers(1, "sequential")).done == 0


def test_time_measures_each_fit_once(task, smoke, bench, tmp_path):
    bench("run", "smoke", "--methods", "kodex,nn", "--out", str(tmp_path), "--jobs", "1")
    assert StoredResults(tmp_path).frame().fit_seconds.isna().all()
    code, said, _ = bench("time", str(tmp_path))
    assert code == 0
    assert said.startswith("door-kodex-described-single-n6-s1: ")
    assert "2 fits timed" in said
    frame = StoredResults(tmp_path).frame()
    times = frame[frame.method != "expert"][["fit_seconds", "action_seconds"]]
    assert (times > 0).all(axis=None)
    assert "0 fits timed" in bench("time", str(tmp_path))[1]


def test_an_audit_evaluates_other_masses_and_other_controllers(task, smoke, bench, tmp_path):
    audit = dict.fromkeys(("variants", "rules", "readings", "controllers"), 3)
    study = replace(get_preset("smoke"), episodes=audit)
    assert not run(study, tmp_path, Workers(1, "sequential")).failed
    frame = StoredResults(tmp_path).frame()
    kodex = frame[(frame.method == "kodex") & (frame.variant == "described")]
    assert set(kodex[kodex.controller == "original"].physics) == {
        "nominal",
        *READINGS["door"],
    }
    assert kodex[kodex.controller == "unclipped"].physics.tolist() == ["nominal"]
    for kind in ("tuned-on-successes", "fine-tuned"):
        assert set(kodex[kodex.controller == kind].physics) == set(VARIATIONS)
    keys = frame[frame.controller != "none"].groupby("controller").controller_key.nunique()
    assert dict(keys) == {
        "original": 1,
        "unclipped": 1,
        "tuned-on-successes": 4,
        "fine-tuned": 4,
    }
    assert bench("report", str(tmp_path))[0] == 0
    tables = tmp_path / "report/tables"
    assert "kodex unclipped,door" in (tables / "audit_variant.csv").read_text()
    assert "door heavy_palm,kodex" in (tables / "audit_physics.csv").read_text()


def test_a_seed_gives_the_same_bytes_alone_and_beside_others_in_any_order_on_any_workers(
    task, smoke, tmp_path, files_of, monkeypatch
):
    monkeypatch.setattr("bench.runner.trained", lambda spec: None)  # each run trains controllers
    study = replace(
        get_preset("smoke"),
        methods=("kodex", "nn"),
        settings={("nn", "epochs"): 2},
        episodes={"success": 4, "ood": 3},
    )
    found, divide_long = [], JobQueue.divide_long
    # The more workers there are, the fewer seeds a job has: here three, two and one.
    for seeds, workers in (((2,), 1), ((3, 2, 1), 1), ((1, 2, 3), 3), ((3, 2, 1), 100)):
        out = tmp_path / str(len(found))
        monkeypatch.setattr(
            JobQueue, "divide_long", lambda queue, _, workers=workers: divide_long(queue, workers)
        )
        run(replace(study, seeds=seeds), out, Workers(1, "sequential"))
        files = files_of(out)
        found.append({path: digest for path, digest in files.items() if "-s2-" in path})
    assert found == found[:1] * 4
    assert sum(path.endswith(".parquet") for path in found[0]) == 3 * 2
    assert sum(path.endswith(".safetensors") for path in found[0]) == 3
