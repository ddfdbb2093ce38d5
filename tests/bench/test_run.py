"""`bench run` and `bench report` as a user meets them, on a small random expert."""

import hashlib
import json
import re
import sys
from dataclasses import replace

import pandas as pd
import pytest

from bench import load
from bench import run as run_from_python
from bench.backend import Workers
from bench.cli_status import progress
from bench.computing import fit_methods
from bench.controller import ControllerConfig
from bench.cores import cores
from bench.costs import fit_cost
from bench.driver import run
from bench.experiments import cells_of
from bench.merge import merge
from bench.parsing import settings
from bench.presets import get_preset
from bench.results import Results as StoredResults
from bench.results_writer import writing
from bench.study_demos import learning_from
from methods import registry
from methods.kodex import Kodex
from reports.exhibits import EXHIBITS
from reports.results import Results
from tasks.demos import demos_key, load_demos
from tasks.demos_files import save_demos
from tasks.errors import InputError
from tasks.masses import READINGS, VARIATIONS
from tasks.recorder import record as record_demos


def without_motions(files):
    """What a report on packed results has: motions are predicted by fits, which are not packed."""
    return {name: digest for name, digest in files.items() if "/motions." not in name}


@pytest.mark.parametrize("task", ["door"], indirect=True)
class TestInProcess:
    def test_a_run_stores_what_it_says_and_the_next_finds_nothing_missing(
        self, task, smoke, bench, tmp_path, files_of
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

    def test_more_episodes_extend_what_is_there(self, task, smoke, tmp_path, monkeypatch, files_of):
        monkeypatch.setattr(type(task), "success", lambda self, r: (1e6 * r[:, -1]) % 2 < 1)
        study = replace(get_preset("smoke"), episodes={"success": 503})
        run(study, tmp_path / "grown", Workers(1, "sequential"))
        larger = replace(study, episodes={"success": 510})
        assert run(larger, tmp_path / "grown", Workers(1, "sequential")).done == 2
        run(larger, tmp_path / "at once", Workers(1, "sequential"))
        assert files_of(tmp_path / "grown") == files_of(tmp_path / "at once")

    def test_status_counts_what_is_done(self, task, smoke, bench, tmp_path):
        bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
        whole = {"controllers": 1, "controllers_done": 1, "run": None}
        whole |= {"fits": 1, "fits_done": 1, "evaluations": 5, "evaluations_done": 5}
        whole |= {"missing_episodes": 0}
        whole |= {"failures": [], "notes": []}
        assert json.loads(bench("status", str(tmp_path), "--json")[1]) == whole
        next(tmp_path.glob("cells/door-kodex*/eval-test*")).unlink()
        assert "evaluations: 4 of 5 done" in bench("status", str(tmp_path))[1]

    def test_status_counts_evaluations_with_all_episodes_that_were_asked_for(
        self, task, smoke, tmp_path, capsys
    ):
        run(get_preset("smoke"), tmp_path, Workers(1, "sequential"))
        results = StoredResults(tmp_path)
        wanted = {one.place: one for one in results.manifest().wanted}
        label = "door-kodex-described-single-n6-s0"
        test, ood = (
            wanted[label, f"eval-{split}-nominal-original-appendix"] for split in ("test", "ood")
        )
        more = replace(test, episodes=test.episodes + 1)
        other = replace(ood, evaluation=replace(ood.evaluation, key=64 * "0"))
        with writing(tmp_path) as writer:
            writer.ask_for([more, other])
        assert progress(results)["evaluations_done"] == 3
        with writing(tmp_path) as writer:
            writer.ask_for([test])
        assert progress(results)["evaluations_done"] == 4
        next(tmp_path.glob("cells/door-kodex*/eval-test*")).write_bytes(b"damaged")
        assert progress(results)["evaluations_done"] == 3
        next(tmp_path.glob("cells/door-kodex*/weights*")).write_bytes(b"damaged")
        assert progress(results)["evaluations_done"] == 2
        assert capsys.readouterr().err.count("is damaged") == 2

    def test_a_plan_prices_what_is_missing(self, task, smoke, bench, tmp_path):
        options = ("smoke", "--jobs", "1", "--out", str(tmp_path))
        before = json.loads(bench("plan", *options, "--json")[1])
        assert before["cells"] == before["missing_evaluations"] == 5
        assert (before["missing_controllers"], before["missing_fits"]) == (1, 1)
        assert before["missing_episodes"] == 2 + 4 * 20
        assert before["cpu_hours"] >= before["wall_hours"] > before["longest_hours"] > 0
        bench("run", *options)
        after = json.loads(bench("plan", *options, "--json")[1])
        assert (after["missing_fits"], after["missing_episodes"], after["cpu_hours"]) == (0, 0, 0)
        assert "5 cells; missing: 0 controllers" in bench("plan", *options)[1]

    def test_options_take_spaces_ranges_exponents_and_all_cores(self, task, smoke, bench, tmp_path):
        plain = ("--tasks", "door", "--methods", "kodex", "--experiments", "success,ood")
        plain += ("--seeds", "3", "--episodes", "10", "--jobs", str(cores()))
        other = ("--tasks", " door,", "--methods", "kodex ,kodex", "--experiments", "ood, success")
        other += ("--seeds", "1-2, 3", "--episodes", "1e1", "--jobs", "-1")
        plans = [
            json.loads(bench("plan", "smoke", *options, "--out", str(tmp_path), "--json")[1])
            for options in (plain, other)
        ]
        counts = ("cells", "missing_fits", "missing_evaluations", "missing_episodes", "memory_gib")
        assert plans[0]["missing_episodes"] == 2 * 10
        assert [plans[0][name] for name in counts] == [plans[1][name] for name in counts]

    def test_a_study_that_does_not_fit_is_refused(self, task, smoke, bench, tmp_path, monkeypatch):
        options = ("plan", "smoke", "--out", str(tmp_path), "--jobs", "1")
        for name, value, answer in (
            ("GIB_PER_JOB", 1e6, "choose fewer with --jobs"),
            ("BYTES_PER_STEP", 1e15, "choose fewer episodes, or another folder"),
        ):
            with monkeypatch.context() as patch:
                patch.setattr(f"bench.plan.{name}", value)
                code, _, error = bench(*options)
            assert code == 2
            assert answer in error

    def test_every_episode_in_one_table(self, task, smoke, bench, tmp_path):
        out, export = tmp_path / "results", tmp_path / "episodes.parquet"
        run_from_python("smoke", out, jobs=1)
        code, _, _ = bench("report", str(out), "--export", str(export))
        assert code == 0
        table = pd.read_parquet(export)
        pd.testing.assert_frame_equal(table, load(out))
        assert len(table) == 2 + 4 * 20
        frame = StoredResults(out).frame()
        counted = table.groupby(["method", "split"], observed=True).success.sum()
        assert dict(counted) == dict(frame.set_index(["method", "split"]).successes)

    def test_merged_parts_are_the_whole(self, task, smoke, bench, tmp_path, files_of):
        whole, a, b, c = (tmp_path / name for name in ("whole", "a", "b", "c"))
        options = ("run", "smoke", "--jobs", "1")
        bench(*options, "--out", str(whole))
        bench(*options, "--out", str(a), "--experiments", "sizes,stability")
        bench(*options, "--out", str(b), "--experiments", "success", "--episodes", "4")
        bench(*options, "--out", str(c), "--experiments", "success,ood")
        bench("time", str(c))
        code, said, _ = bench("merge", str(a), str(b), str(c), "--out", str(tmp_path / "out"))
        assert (code, said) == (0, f"2 fits in {tmp_path / 'out'}\n")
        assert files_of(tmp_path / "out") == files_of(whole)
        merged, alone = StoredResults(tmp_path / "out").frame(), StoredResults(whole).frame()
        assert (merged[merged.method == "kodex"].fit_seconds > 0).all()
        pd.testing.assert_frame_equal(
            merged.drop(columns="fit_seconds"), alone.drop(columns="fit_seconds")
        )

    @pytest.mark.parametrize(
        "name",
        ["cells/door-kodex*/eval-test*", "cells/door-kodex*/weights*", "controllers/*/weights*"],
    )
    @pytest.mark.parametrize("harm", ["flipped", "cut"])
    def test_what_is_damaged_in_the_target_is_merged_anew(
        self, task, smoke, tmp_path, capsys, files_of, name, harm
    ):
        whole, out = tmp_path / "whole", tmp_path / "out"
        run(get_preset("smoke"), whole, Workers(1, "sequential"))
        merge([whole], out)
        path = next(out.glob(name))
        data = path.read_bytes()
        middle = len(data) // 2
        flipped = data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]
        path.write_bytes(flipped if harm == "flipped" else data[:-7])
        merge([whole], out)
        assert files_of(out) == files_of(whole)
        assert "set aside as" in capsys.readouterr().err

    def test_what_is_merged_is_flushed_before_it_appears(self, task, smoke, tmp_path, monkeypatch):
        def fail(handle):
            raise OSError("full")

        run(get_preset("smoke"), tmp_path / "whole", Workers(1, "sequential"))
        monkeypatch.setattr("os.fsync", fail)
        with pytest.raises(OSError, match="full"):
            merge([tmp_path / "whole"], tmp_path / "out")
        assert not (tmp_path / "out/cells").exists()

    def test_what_was_not_run_alike_is_not_merged(self, task, smoke, bench, tmp_path, monkeypatch):
        for name, version in (("a", 1), ("b", 2)):
            monkeypatch.setattr(Kodex, "version", version)
            bench("run", "smoke", "--out", str(tmp_path / name), "--jobs", "1")
        folders = (str(tmp_path / "a"), str(tmp_path / "b"))
        code, _, error = bench("merge", *folders, "--out", str(tmp_path / "out"))
        assert code == 2
        assert "holds other results of door-kodex-described-single-n6-s0" in error
        assert not (tmp_path / "out/cells").exists()

    def test_what_is_damaged_is_computed_again(self, task, smoke, tmp_path, capsys, files_of):
        study = get_preset("smoke")
        run(study, tmp_path, Workers(1, "sequential"))
        before = files_of(tmp_path)
        path = next(tmp_path.glob("cells/door-kodex*/weights.safetensors"))
        path.write_bytes(path.read_bytes()[:-1])
        # The fit and all three evaluations of it.
        assert run(study, tmp_path, Workers(1, "sequential")).done == 4
        assert files_of(tmp_path) == before
        assert "set aside" in capsys.readouterr().err

    def test_results_of_another_controller_are_refused_before_anything_runs(
        self, task, smoke, tmp_path, files_of
    ):
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
            assert "of door-kodex-described-single-n6-s0 with" in str(refusal.value)
            assert "choose another folder" in str(refusal.value)
        assert files_of(tmp_path) == before
        assert StoredResults(tmp_path).manifest() == asked

    def test_results_of_another_version_are_set_aside_and_computed_again(
        self, task, smoke, tmp_path, monkeypatch, capsys
    ):
        study = get_preset("smoke")
        run(study, tmp_path, Workers(1, "sequential"))
        before = {path.read_bytes() for path in tmp_path.glob("cells/door-kodex*/eval-*")}
        monkeypatch.setattr("bench.controller.VERSION", 2)
        # The controller, and all three evaluations that it has a part in.
        assert run(study, tmp_path, Workers(1, "sequential")).done == 4
        assert capsys.readouterr().err.count("set aside as") == 3
        assert {path.read_bytes() for path in (tmp_path / "damaged").iterdir()} == before
        assert run(study, tmp_path, Workers(1, "sequential")).done == 0

    @pytest.mark.parametrize("written", ["64,32", "(64, 32)", "[64,32]"])
    def test_a_tuple_may_be_set_with_or_without_brackets(self, task, smoke, written):
        (place, value), *_ = settings([f"ngf.hidden={written}"]).items()
        study = replace(get_preset("smoke"), methods=("ngf",), settings={place: value})
        study = replace(study, episodes={"success": 1})
        configs = [cell.fit.config for cell in cells_of(study, {"door": "key"})]
        assert [config["hidden"] for config in configs if config] == [[64, 32]]

    def test_other_settings_are_other_cells(self, task, smoke, bench, tmp_path):
        out = ("--out", str(tmp_path), "--jobs", "1")
        bench("run", "smoke", *out)
        assert bench("run", "smoke", *out, "--set", "kodex.observables=1")[1].startswith(
            "4 results"
        )
        frame = StoredResults(tmp_path).frame()
        configs = frame[frame.split == "validation"].set_index("settings").config
        assert {name: config["observables"] for name, config in configs.items()} == {
            "": 3,
            "observables=1": 1,
        }

    def test_results_of_two_settings_stand_side_by_side(self, task, smoke, bench, tmp_path):
        options = ("--out", str(tmp_path), "--jobs", "1", "--experiments", "success")
        labels = [f"kodex:observables={number}" for number in (1, 2)]
        for number in (1, 2):
            bench("run", "smoke", *options, "--set", f"kodex.observables={number}")
        assert set(load(tmp_path).method) == {"expert", *labels}
        for names in ("kodex", ",".join(labels)):
            pairs = json.loads(bench("compare", str(tmp_path), "--methods", names, "--json")[1])
            assert [[pair["left"], pair["right"]] for pair in pairs] == [labels]
        for label in labels:
            words = ("--method", label, "--task", "door")
            code, said, _ = bench("failures", str(tmp_path), *words)
            assert code == 0
            assert f"| door   | {label} " in said
        assert bench("report", str(tmp_path))[0] == 0
        table = (tmp_path / "report/tables/success.md").read_text()
        for number in (1, 2):
            assert f"KODex observables={number} " in table

    def test_a_fit_that_fails_hides_no_other_of_the_method(
        self, task, smoke, bench, tmp_path, monkeypatch
    ):
        def fit(self, demos, validation, seed):
            if self.config.observables == 2:
                raise ZeroDivisionError("two never works")
            own(self, demos, validation, seed)

        own = Kodex.fit
        monkeypatch.setattr(Kodex, "fit", fit)
        options = ("--out", str(tmp_path), "--jobs", "1", "--experiments", "success")
        for number, code in ((1, 0), (2, 3), (1, 0)):
            setting = ("--set", f"kodex.observables={number}")
            assert bench("run", "smoke", *options, *setting)[0] == code
        assert set(load(tmp_path).method) == {"expert", "kodex"}
        (failure,) = StoredResults(tmp_path).failures()
        assert failure["label"] == "door-kodex-observables=2-described-single-n6-s0"

    def test_the_report_has_table_1_with_interval_n_and_the_published_value(
        self, task, smoke, bench, tmp_path
    ):
        bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
        code, said, _ = bench("report", str(tmp_path))
        assert code == 0
        assert "| KODex  |" in said
        folder = tmp_path / "report"
        header, row = (folder / "tables/table_1.csv").read_text().splitlines()
        assert header.startswith("row,column,value,spread,low,high,seeds,n,diverged,published,")
        assert row.split(",")[:2] == ["kodex", "door"]
        assert row.split(",")[6:10] == ["1", "2", "0", "96.0"]
        assert r"\toprule" in (folder / "tables/table_1.tex").read_text()
        for ending in ("png", "pdf", "svg"):
            assert (folder / f"figures/table_1.{ending}").stat().st_size > 1000

    def test_a_report_without_an_exhibit_that_fails_ends_with_exit_code_3(
        self, task, smoke, bench, tmp_path, monkeypatch
    ):
        bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
        monkeypatch.setattr("reports.results.Results.diagnostics", lambda self, folder: {})
        code, said, error = bench("report", str(tmp_path))
        assert code == 3
        assert "bench: left out: Table 12: largest eigenvalue magnitude: InputError: " in error
        assert "has stored no eigenvalues" in error
        assert "## Success on test starts" in said

    def test_a_report_prints_success_the_answer_and_the_page_and_all_tables_on_demand(
        self, task, smoke, bench, tmp_path
    ):
        bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
        code, said, _ = bench("report", str(tmp_path))
        assert code == 0
        titles = [line for line in said.splitlines() if line.startswith("## ")]
        assert titles == ["## Success on test starts"]
        assert "Door: KODex is the only method, " in said
        assert said.endswith(
            f" tables to {tmp_path / 'report'}\npage: {tmp_path / 'report/index.html'}\n"
        )
        assert "numbers mean nothing" in said
        said = bench("report", str(tmp_path), "--tables")[1]
        assert "## Table 1: success of KODex on the validation starts" in said
        assert "Intervals are 95%" in said

    def test_packed_results_give_the_same_report(self, task, smoke, bench, tmp_path, files_of):
        out, small = tmp_path / "results", tmp_path / "small"
        bench("run", "smoke", "--out", str(out), "--jobs", "1")
        bench("report", str(out))
        code, said, _ = bench("pack", str(out), "--out", str(small))
        assert code == 0
        assert f"bench report {small} shows them" in said
        assert len({path.stat().st_mode for path in small.iterdir()}) == 1  # all who may read one
        bench("report", str(small))
        assert files_of(small / "report") == without_motions(files_of(out / "report"))
        found = json.loads(bench("verify", str(small), "--jobs", "1", "--cells", "9", "--json")[1])
        assert [one["verdict"] for one in found] == ["identical"] * 5

    def test_demonstrations_of_a_file_take_the_place_of_the_experts(
        self, task, smoke, bench, tmp_path
    ):
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
    def test_demonstrations_of_another_task_are_refused(
        self, task, smoke, bench, tmp_path, options, answer
    ):
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
    def test_a_file_without_sound_demonstrations_is_refused(
        self, task, smoke, bench, tmp_path, harm, answer
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

    def test_parts_pack_into_one(self, task, smoke, bench, tmp_path, files_of, monkeypatch):
        folders = [tmp_path / name for name in ("whole", "part", "more", "packed", "other")]
        whole, part, more, packed, other = map(str, folders)
        run = ("run", "smoke", "--jobs", "1", "--out")
        bench(*run, whole)
        bench(*run, part, "--episodes", "5")
        bench(*run, more, "--experiments", "success,ood")
        bench("pack", part, "--out", packed)
        alone = pd.read_parquet(tmp_path / "packed/evaluations.parquet")
        with writing(tmp_path / "empty") as empty:
            empty.ask_for([])
        bench("pack", part, str(empty.folder), "--out", packed)
        beside = pd.read_parquet(tmp_path / "packed/evaluations.parquet")
        pd.testing.assert_frame_equal(beside, alone)
        assert bench("pack", packed, more, "--out", packed)[0] == 0
        episodes = pd.read_parquet(tmp_path / "packed/episodes.parquet")
        assert len(episodes) == 2 * (20 + 20) + 2
        for folder in (whole, packed):
            bench("report", folder)
        ours = files_of(tmp_path / "whole/report")
        assert files_of(tmp_path / "packed/report") == without_motions(ours)
        monkeypatch.setattr(Kodex, "version", 2)
        bench(*run, other)
        code, _, error = bench("pack", packed, other, "--out", packed)
        assert code == 2
        assert "different results of door-kodex-described-single-n6-s0" in error
        pd.testing.assert_frame_equal(
            episodes, pd.read_parquet(tmp_path / "packed/episodes.parquet")
        )

    def test_times_stay_when_a_part_with_more_episodes_has_none(self, task, smoke, bench, tmp_path):
        timed, more, packed = (str(tmp_path / name) for name in ("timed", "more", "packed"))
        run = ("run", "smoke", "--jobs", "1", "--out")
        bench(*run, timed, "--episodes", "5")
        bench("time", timed)
        bench(*run, more)
        bench("pack", timed, more, "--out", packed)
        rows = pd.read_parquet(tmp_path / "packed/evaluations.parquet").query("method == 'kodex'")
        assert rows.fit_seconds.notna().all()
        assert (rows[rows.split != "validation"].episodes > 5).all()

    def test_shipped_results_are_laid_beside_those_of_a_run(
        self, task, smoke, bench, tmp_path, monkeypatch
    ):
        out, theirs, small = tmp_path / "mine", tmp_path / "theirs", tmp_path / "small"
        options = ("--jobs", "1", "--set", "nn.epochs=1", "--out")
        bench("run", "smoke", "--methods", "kodex,nn", *options, str(theirs))
        bench("run", "smoke", "--methods", "kodex", *options[:2], "--out", str(out))
        bench("pack", str(theirs), "--out", str(small))
        monkeypatch.setattr("bench.packed.SHIPPED", small)
        export = tmp_path / "all.parquet"
        code, _, error = bench("report", str(out), "--with-reference", "--export", str(export))
        assert (code, error) == (0, "")
        assert "From another machine, as shipped: nn." in (out / "report/index.html").read_text()
        rows = (out / "report/tables/success.csv").read_text()
        assert "nn,door" in rows
        assert set(pd.read_parquet(export).method) == {"kodex", "nn"}
        pair = ("--methods", "kodex,nn", "--json")
        rows = json.loads(bench("compare", str(out), "--with-reference", *pair)[1])
        assert [row["split"] for row in rows] == ["test", "ood"]
        assert json.loads(bench("compare", str(theirs), *pair)[1]) == rows

    def test_shipped_results_of_another_protocol_are_refused(
        self, task, smoke, bench, tmp_path, monkeypatch
    ):
        out, theirs, small = tmp_path / "mine", tmp_path / "theirs", tmp_path / "small"
        study = replace(get_preset("smoke"), methods=("nn",), settings={("nn", "epochs"): 1})
        run(replace(study, controller=ControllerConfig(epochs=6)), theirs, Workers(1))
        bench("run", "smoke", "--jobs", "1", "--out", str(out))
        bench("pack", str(theirs), "--out", str(small))
        monkeypatch.setattr("bench.packed.SHIPPED", small)
        pair = ("--methods", "kodex,nn")
        report, compare = ("report", str(out)), ("compare", str(out), *pair)
        command = f"--tasks door --methods kodex --out {out}-paper\n"
        for words, experiments in ((report, "sizes,success,ood"), (compare, "success,ood")):
            code, said, error = bench(*words, "--with-reference")
            assert (code, said) == (2, "")
            assert error.startswith(f"bench: {out} and the shipped results cannot be compared")
            assert re.search(r"controller epochs +5 +6\n", error)
            assert error.endswith(f"bench run paper --experiments {experiments} {command}")
        code, said, _ = bench(*report, "--with-reference", "--mixed")
        note = f"{out} (controller epochs 5); shipped (controller epochs 6)"
        assert code == 0
        assert "| KODex* |" in said
        assert "An asterisk marks" in (out / "report/tables/success.md").read_text()
        for place in (said, (out / "report/index.html").read_text()):
            assert note in place
        code, said, _ = bench(*compare, "--with-reference", "--mixed")
        assert code == 0
        assert "| kodex* |" in re.sub(" +", " ", said)
        assert note in said
        code, said, error = bench(*compare, "--with-reference", "--mixed", "--json")
        assert {row["left"] for row in json.loads(said)} == {"kodex"}
        assert note in error

    def test_methods_of_one_folder_that_were_run_otherwise_are_refused(
        self, task, smoke, bench, tmp_path
    ):
        file, out = tmp_path / "mine.safetensors", str(tmp_path / "results")
        save_demos(load_demos(task)[:5], file)
        options = ("run", "smoke", "--jobs", "1", "--out", out)
        bench(*options, "--demos", str(file))
        bench(*options, "--methods", "nn", "--set", "nn.epochs=1")
        for words in (("report", out), ("compare", out, "--methods", "kodex,nn")):
            code, _, error = bench(*words)
            assert code == 2
            assert error.startswith("bench: kodex and nn cannot be compared on door\n")
            assert re.search(r"demos +3 +6\n +demos of +\w{8} +the expert\n", error)
        assert bench("compare", out, "--methods", "kodex, expert,")[0] == 0
        assert "kodex (demos 3, demos of" in bench("report", out, "--mixed")[1]

    def test_the_expert_beside_demonstrations_of_a_file_is_said_to_be_the_suites_own(
        self, task, smoke, bench, tmp_path
    ):
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

    def test_controllers_of_the_suites_expert_are_named_beside_demonstrations_of_a_file(
        self, task, smoke, tmp_path
    ):
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

    def test_nothing_shipped_lies_beside_nothing(self, task, smoke, bench, tmp_path, monkeypatch):
        monkeypatch.setattr("bench.packed.SHIPPED", tmp_path / "nothing")
        bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
        code, _, error = bench("report", str(tmp_path), "--with-reference")
        assert code == 2
        assert "no reference results are shipped" in error

    def test_fits_of_several_versions_are_shown_only_when_asked_for(
        self, task, smoke, bench, tmp_path, monkeypatch
    ):
        bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
        monkeypatch.setattr("bench.provenance.version", lambda name: "9.9")
        options = ("--methods", "nn", "--set", "nn.epochs=1", "--jobs", "1")
        bench("run", "smoke", *options, "--out", str(tmp_path))
        code, _, error = bench("report", str(tmp_path))
        assert code == 2
        assert "9.9" in error
        assert "give --mixed" in error
        assert bench("report", str(tmp_path), "--mixed")[0] == 0

    def test_a_controller_without_a_success_to_learn_from_is_a_failure_of_its_own(
        self, task, smoke, tmp_path, monkeypatch
    ):
        def record(task, starts, expert, physics, failures, raw):
            success, demos = record_demos(task, starts, expert, physics, failures=failures)
            return success, demos[:0] if physics == "heavy_hand" else demos

        study = replace(get_preset("smoke"), tasks=("door",), episodes={"audit": 3})
        monkeypatch.setattr("bench.training_data.record", record)
        (failed,) = run(study, tmp_path, Workers(1, "sequential")).failed
        assert failed.startswith(
            "door-tuned-on-successes-heavy_hand: TrainingError: controller of door has no samples"
            " to learn from"
        )
        tried = StoredResults(tmp_path).frame().query("controller == 'tuned-on-successes'").physics
        assert set(tried) == {*VARIATIONS} - {"heavy_hand"}

    def test_an_audit_tries_other_masses_and_other_controllers(self, task, smoke, bench, tmp_path):
        study = replace(get_preset("smoke"), tasks=("door",), episodes={"audit": 3})
        assert not run(study, tmp_path, Workers(1, "sequential")).failed
        frame = StoredResults(tmp_path).frame()
        kodex = frame[(frame.method == "kodex") & (frame.variant == "described")]
        assert set(kodex[kodex.controller == "original"].physics) == {
            "nominal",
            *READINGS["door"],
        }
        assert kodex[kodex.controller == "unclipped"].physics.tolist() == ["nominal"]
        assert set(kodex[kodex.controller == "tuned-on-successes"].physics) == set(VARIATIONS)
        keys = frame[frame.controller != "none"].groupby("controller").controller_key.nunique()
        assert dict(keys) == {
            "original": 1,
            "unclipped": 1,
            "tuned-on-successes": 4,
            **{f"original-{seed}": 1 for seed in (2, 3, 4, 5)},
        }
        weights = [
            p.read_bytes() for p in tmp_path.glob("controllers/door-original*/*.safetensors")
        ]
        assert len(set(weights)) == 5
        assert bench("report", str(tmp_path))[0] == 0
        tables = tmp_path / "report/tables"
        luck = pd.read_csv(tables / "audit_controller.csv")
        assert set(luck.row) == {"kodex door"}
        each, mean = luck[luck.column != "mean"], luck[luck.column == "mean"]
        assert each.column.tolist() == ["original", *(f"original-{s}" for s in (2, 3, 4, 5))]
        assert (each.n == 3).all()
        assert mean.value.item() == pytest.approx(each.value.mean())
        assert "kodex unclipped,door" in (tables / "audit.csv").read_text()
        assert "door heavy_palm,kodex" in (tables / "audit_appendix_i.csv").read_text()

    def test_fits_are_timed_once_and_apart_from_the_run(self, task, smoke, bench, tmp_path):
        bench("run", "smoke", "--methods", "kodex,nn", "--out", str(tmp_path), "--jobs", "1")
        assert StoredResults(tmp_path).frame().fit_seconds.isna().all()
        code, said, _ = bench("time", str(tmp_path))
        assert code == 0
        assert said.startswith("door-kodex-described-single-n6-s0: ")
        assert "2 fits timed" in said
        frame = StoredResults(tmp_path).frame()
        assert (frame[frame.method != "expert"].fit_seconds > 0).all()
        assert "0 fits timed" in bench("time", str(tmp_path))[1]

    def test_a_report_is_of_one_thing(self, task, smoke, bench, tmp_path):
        for options in ((), (str(tmp_path), "--reference")):
            code, _, error = bench("report", *options)
            assert code == 2
            assert "give a results folder or --reference" in error

    def test_a_report_of_the_same_results_has_the_same_bytes(
        self, task, smoke, bench, tmp_path, files_of
    ):
        bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
        bench("report", str(tmp_path))
        before = files_of(tmp_path)
        bench("report", str(tmp_path))
        assert files_of(tmp_path) == before

    @pytest.mark.parametrize(
        ("options", "answer"),
        [
            (("smok",), "did you mean 'smoke'"),
            (("smoke", "--tasks", "dor"), "did you mean 'door'"),
            (("smoke", "--methods", "kodx"), "did you mean 'kodex'"),
            (("smoke", "--tasks", "door, relocate"), "did you mean 'relocation'"),
            (("smoke", "--tasks", ","), "--tasks takes names separated by commas"),
            (("smoke", "--sizes", "singel"), "did you mean 'single'"),
            (
                ("smoke", "--sizes", "small"),
                "has the size 'small'; methods that have it: nn, lstm, ndp",
            ),
            (("smoke", "--variants", "publishd"), "choose from described"),
            (("smoke", "--variants", "described"), "presets with audit: paper"),
            (("smoke", "--experiments", "suces"), "did you mean 'success'"),
            (
                ("smoke", "--experiments", "success,robustness"),
                "the preset smoke has no experiment 'robustness': use paper, or choose from sizes,",
            ),
            (("smoke", "--experiments", "lifting"), "use quick or paper, or choose from"),
            (("smoke", "--seeds", "x"), "--seeds takes a number"),
            (("smoke", "--seeds", "0"), "--seeds takes a number"),
            (("smoke", "--episodes", "0"), "whole number from 1"),
            (("smoke", "--episodes", "1.5"), "got '1.5'"),
            (("smoke", "--jobs", "0"), "jobs must be 1 or more, or -1 for one on each core, got"),
            (("smoke", "--jobs", "-2"), "jobs must be 1 or more"),
            (("smoke", "--backend", "lok"), "did you mean 'loky'"),
            (("smoke", "--limit", "nan"), "--limit must be above 0"),
            (("smoke", "--limit", "inf"), "--limit must be above 0, and finite, got inf"),
            (("smoke", "--set", "kodex"), "METHOD.FIELD=VALUE"),
            (("smoke", "--set", "kodex.observabls=2"), "did you mean 'observables'"),
            (("smoke", "--set", "kodx.observables=2"), "did you mean 'kodex'"),
            (("smoke", "--set", "nn.epochs=2"), "not among the methods of the run (kodex)"),
            (("smoke", "--set", "kodex.observables=9"), "choose from [1, 2, 3, 4]"),
            (("smoke", "--set", "kodex.cutoff=-1"), "cutoff must be 0 or more, got -1"),
            (
                ("smoke", "--methods", "ngf", "--set", "ngf.hidden=[64]"),
                "ngf.hidden takes tuple[int, int], got [64]; for example --set ngf.hidden=64,32",
            ),
            (
                ("smoke", "--methods", "nn", "--set", "nn.residual=yes"),
                "nn.residual takes bool, got 'yes'; for example --set nn.residual=true",
            ),
        ],
    )
    def test_what_does_not_exist_is_refused(self, task, smoke, bench, tmp_path, options, answer):
        out = tmp_path / "results"
        code, said, error = bench("run", *options, "--out", str(out))
        assert (code, said) == (2, "")
        assert answer in error
        assert not out.exists()


class Failing(Kodex):
    name = "failing"
    version = 7
    deterministic = False

    def fit(self, demos, validation, seed):
        if seed == 2:
            raise ZeroDivisionError("seed two never works")
        super().fit(demos, validation, seed)


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_failure_is_noted_and_the_rest_goes_on(task, smoke, bench, tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "_CLASSES", registry._CLASSES | {"failing": "Failing"})
    monkeypatch.setattr("methods.kodex.Failing", Failing, raising=False)
    monkeypatch.setattr(registry, "import_module", lambda name: sys.modules["methods.kodex"])
    registry.get_method.cache_clear()
    options = ("--methods", "failing", "--experiments", "success", "--seeds", "3", "--jobs", "1")
    for tries in (1, 2):
        code, _, error = bench("run", "smoke", *options, "--out", str(tmp_path))
        assert code == 3
        assert "seed 2: fit raised ZeroDivisionError: seed two never works" in error
        (failure,) = StoredResults(tmp_path).failures()
        assert failure["tries"] == tries
        assert "in fit" in failure["traceback"]
    assert set(StoredResults(tmp_path).frame().seed) == {1, 3}
    monkeypatch.setattr(Failing, "fit", Kodex.fit)
    assert bench("run", "smoke", *options, "--out", str(tmp_path))[0] == 0
    assert StoredResults(tmp_path).failures() == []
    registry.get_method.cache_clear()


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_failure_is_forgotten_once_its_evaluation_succeeds_in_pieces(
    task, smoke, tmp_path, monkeypatch
):
    def rollout(*arguments, **options):
        raise MemoryError("too many episodes")

    study = replace(get_preset("smoke"), episodes={"ood": 8})
    with monkeypatch.context() as patch:
        patch.setattr("bench.computing.rollout", rollout)
        assert len(run(study, tmp_path, Workers(1, "sequential")).failed) == 2
    assert len(StoredResults(tmp_path).failures()) == 2
    monkeypatch.setattr("bench.missing.CHUNK", 2)
    for episodes in (4, 8):
        run(replace(study, episodes={"ood": episodes}), tmp_path, Workers(1, "sequential"))
    assert StoredResults(tmp_path).failures() == []


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_the_longest_job_begins_first(task, smoke, tmp_path, monkeypatch):
    begun = []

    def noted(fits, demos, validation):
        begun.append(fit_cost(fits).seconds)
        return fit_methods(fits, demos, validation)

    monkeypatch.setattr("bench.jobs.fit_methods", noted)
    study = replace(get_preset("smoke"), methods=("kodex", "ndp", "nn"), episodes={"success": 5})
    run(study, tmp_path, Workers(1, "sequential"))
    assert begun == sorted(begun, reverse=True)
    assert len(begun) == 3
