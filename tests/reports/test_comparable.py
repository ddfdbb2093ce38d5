"""Submitted rows beside the shipped results: which are refused, and what the page shows."""

import re
import shutil
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import resealed
from resealed import reseal

from bench.computing import Evaluated
from bench.controller import ControllerConfig
from bench.controller_kinds import ORIGINAL
from bench.package_source import PackageSource
from bench.packed import SHIPPED, pack
from bench.provenance import provenance, software
from bench.repeatable import check_repeatable
from bench.results_writer import writing
from bench.spec import Cell, ControllerSpec, Evaluation, Fit
from bench.submission import Submission
from methods.nearest import Nearest
from methods.registry import introduced
from reports import submitted_rows
from reports.exhibits.success import EXHIBIT
from reports.results import Results
from tasks.data import Episodes, Starts, generator
from tasks.errors import InputError
from tasks.files import to_bytes
from tasks.pins import PINNED

STARTS = 12


class Mine(Nearest):
    name = "mine"


def store(folder, *methods, tasks=("door",), seeds=(1, 2), demos=6, epochs=5):
    """Stores made-up results of methods, as a run would."""
    with writing(folder) as writer:
        for task in tasks:
            for seed in seeds:
                config, key = ControllerConfig(epochs=epochs), "d" * 64
                controller = ControllerSpec(task, ORIGINAL, config, demos, key, seed)
                writer.add_controller(controller, to_bytes({"w": np.ones(2)}), provenance(0.0))
                for method in methods:
                    fit = Fit(task, method, "described", "single", {}, demos, seed, key)
                    test = Evaluation(task, "test", controller_key=controller.key)
                    weights = to_bytes({"w": generator(fit.key).random(3)})
                    writer.ask_for([Cell(fit, test, STARTS, controller).wanted])
                    writer.add_fit(fit, weights, b"", provenance(0.0))
                    writer.add_episodes(fit, test, evaluated(task, fit.key))
    return folder


def evaluated(task, seed):
    rng = generator(seed)
    starts = Starts(task, "test", np.arange(STARTS), np.zeros((STARTS, 3)))
    success, steps = rng.random(STARTS) < 0.6, np.full(STARTS, 9)
    readings = rng.random((STARTS, 9))
    made = Episodes(starts, success, np.zeros(STARTS, bool), steps, readings)
    return Evaluated(made, software())


@pytest.fixture
def shipped(tmp_path, monkeypatch):
    """Ships results of two methods; the package of a third is as if it were installed."""
    monkeypatch.chdir(tmp_path)
    pack([store(tmp_path / "theirs", "kodex", "nearest")], tmp_path / "small")
    monkeypatch.setattr("bench.packed.SHIPPED", tmp_path / "small")
    package = PackageSource("mine-package", "0.1.0", {"mine.py": "0" * 64})
    monkeypatch.setattr("reports.submitting.package_source", lambda method: package)
    monkeypatch.setattr("reports.submitting.known", lambda method: Mine)
    monkeypatch.setattr("reports.submitting.check_repeatable", lambda row: None)
    monkeypatch.setattr("bench.repeatable.package_methods", lambda: ["mine"])
    monkeypatch.setattr("bench.repeatable.package_source", lambda method: package)
    monkeypatch.setattr("bench.repeatable.known", lambda method: Mine)
    with introduced() as introduce:
        introduce(Mine)
        yield


@pytest.fixture
def row(shipped, bench):
    """The file of a row."""
    code, said, error = bench("submit", str(store(Path("mine"), "mine")), "--out", "mine.parquet")
    assert (code, error) == (0, "")
    assert said.startswith("mine of mine-package 0.1.0: 2 evaluations, 24 episodes in mine.parq")
    return Path("mine.parquet")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (resealed.flip, "door, seed 1, test: the counts are not those of its episodes"),
        (resealed.swap_seeds, "door, seed 2, test: the fit has not the key of its fields"),
        (resealed.name_another_controller, "door, seed 1: controller ffffffffffff, not "),
        (resealed.train_controllers_longer, "seed 1: the controller has not the fields of the"),
        (resealed.learn_from_other_demonstrations, "seed 2: demonstrations eeeeeeeeeeee, not ddd"),
        (resealed.take_weights_from_a_file, "seed 1: weights of a file, whose training cannot"),
        (resealed.drop_a_seed, "it lacks 12 starts of test on door (seed 2)"),
        (
            resealed.choose_starts,
            "door, seed 1, test: the starts are not the first 12 of the split",
        ),
        (resealed.leave_out_what_it_has, "it says that it leaves out door, which it has"),
        (resealed.claim_the_name_of_the_suite, "a method cannot be called 'nn': there is a method"),
    ],
)
def test_a_row_that_was_changed_and_sealed_again_is_refused(row, bench, change, reason):
    reseal(row, change)
    code, said, error = bench("verify", str(row), "--jobs", "1")
    assert (code, said) == (2, "")
    assert reason in error


def test_a_row_of_which_a_bit_was_changed_is_damaged(row, bench):
    content = bytearray(row.read_bytes())
    content[len(content) // 2] ^= 1
    row.write_bytes(content)
    code, _, error = bench("verify", str(row), "--jobs", "1")
    assert code == 2
    assert "mine.parquet is damaged (its content is not what was written)" in error


def test_a_file_that_is_no_row_is_refused(shipped, bench):
    code, _, error = bench("verify", "small/episodes.parquet", "--jobs", "1")
    assert code == 2
    assert "name a file of `bench submit`" in error


def test_an_incomplete_row_is_refused_with_the_command_that_completes_it(shipped, bench):
    code, _, error = bench("submit", str(store(Path("part"), "mine", seeds=(1,))), "--out", "x")
    assert code == 2
    assert "mine lacks what the shipped methods have: 12 starts of test on door (seed 2)" in error
    assert (
        "bench run paper --experiments success --tasks door --methods mine --seeds 2,"
        " --episodes 12 --out part" in error
    )
    assert not Path("x").exists()


def test_a_row_names_the_tasks_that_it_leaves_out(shipped, bench, tmp_path):
    both = store(tmp_path / "both", "kodex", "nearest", tasks=("door", "tool"))
    pack([both], tmp_path / "small")
    command = ("submit", str(store(Path("mine"), "mine")), "--out", "mine.parquet")
    code, _, error = bench(*command)
    assert code == 2
    assert "12 starts of test on tool (seeds 1, 2)" in error
    assert bench(*command, "--missing", "tool")[0] == 0
    assert Submission(Path("mine.parquet")).origin.missing == ("tool",)
    code, _, error = bench(*command, "--missing", "tool,door")
    assert code == 2
    assert "--missing leaves out every task of the shipped results" in error


def test_a_row_of_another_protocol_is_refused_with_what_differs(shipped, bench):
    other = store(Path("other"), "mine", demos=5, epochs=9)
    code, _, error = bench("submit", str(other), "--out", "mine.parquet")
    assert code == 2
    found = [line.split() for line in error.splitlines()]
    assert ["demos", "5", "6"] in found
    assert ["controller", "epochs", "9", "5"] in found
    assert "get comparable rows: bench run paper --experiments success --tasks door" in error


def test_a_method_of_the_suite_is_no_row(shipped, bench):
    code, _, error = bench("submit", "theirs", "--out", "x.parquet")
    assert code == 2
    assert "theirs holds no method of a package: kodex, nearest are the suite's" in error


@pytest.mark.skipif(software()["pins"] != PINNED, reason="kernels are not pinned here")
def test_a_row_is_repeated_with_its_own_source_and_versions_only(row, monkeypatch):
    check_repeatable(Submission(row))

    def age(record, episodes):
        for facts in record["fits"].values():
            facts["versions"]["numpy"] = "1.0"
        return episodes

    other = PackageSource("mine-package", "0.2.0", {"mine.py": "1" * 64})
    with monkeypatch.context() as patch:
        patch.setattr("bench.repeatable.package_source", lambda method: other)
        with pytest.raises(InputError, match=r"installed \(mine-package 0.2.0\): mine.py differs"):
            check_repeatable(Submission(row))
    with monkeypatch.context() as patch:
        patch.setattr("bench.repeatable.package_methods", lambda: [])
        with pytest.raises(InputError, match=r"the package mine-package 0.1.0: install it"):
            check_repeatable(Submission(row))
    with monkeypatch.context() as patch:
        patch.setattr("bench.repeatable.known", lambda method: SimpleNamespace(version=2))
        with pytest.raises(InputError, match="says that mine has version 1, and 2 is installed"):
            check_repeatable(Submission(row))
    reseal(row, age)
    with pytest.raises(InputError, match=f"here: numpy 1.0 in the row, {version('numpy')} here"):
        check_repeatable(Submission(row))


def test_the_page_shows_valid_rows_below_the_suites_own(row, bench, tmp_path, monkeypatch):
    folder = tmp_path / "submitted"
    folder.mkdir()
    for name in ("a", "b", "changed"):
        shutil.copy(row, folder / f"{name}.parquet")
    reseal(folder / "b.parquet", resealed.flip_and_count)
    reseal(folder / "changed.parquet", resealed.swap_seeds)
    digest = Submission(folder / "a.parquet").digest
    proof = f'["{digest}"]\nby = "Ada"\non = 2026-12-01\nevaluations = 2\n'
    (folder / "verified.toml").write_text(proof)
    monkeypatch.setattr(submitted_rows, "SUBMITTED", folder)
    monkeypatch.setattr("reports.write.EXHIBITS", [replace(EXHIBIT, axis="")])
    code, _, error = bench("report", "--reference", "--out", "page")
    assert code == 3
    assert "left out: submitted row changed.parquet: changed.parquet: door, seed" in error
    page = Path("page/index.html").read_text()
    suite, below = page.partition('<tbody class="submitted">')[::2]
    assert re.findall('<th scope="row">(.*?)</th>', suite) == ["KODex", "Nearest"]
    marks = re.findall(r'<th scope="row">mine <span class="mark">(\w+)</span>', below)
    assert marks == ["verified", "submitted"]
    assert "mine: mine-package 0.1.0, 2 evaluations repeated by Ada on 2026-12-01." in below
    shown = Submission(folder / "a.parquet").frame()
    assert f"<td>{100 * shown.successes.sum() / shown.episodes.sum():.1f} [" in below


def test_the_rows_that_are_shipped_can_be_shown():
    found = submitted_rows.submitted_rows(Results(SHIPPED), submitted_rows.SUBMITTED)
    assert found.refused == {}
