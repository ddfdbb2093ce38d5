"""A method of a package, from its run to its row: `bench submit` and `bench verify FILE`."""

import importlib
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from resealed import flip_and_count, record_of, reseal, swap_seeds_and_keys

from bench.controller import ControllerConfig
from bench.presets import PRESETS
from bench.submission import Submission
from methods import registry

DOCS = Path(__file__).parents[2] / "docs/submit.md"
EXAMPLE = DOCS.parent / "examples/copycat"
PIP = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
PACKAGES = ("copycat", "knn")

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with the example of the documents, and with what `bench new-method` writes."""
    place = tmp_path_factory.mktemp("packages")
    shutil.copytree(EXAMPLE, place / "copycat")
    code = "from bench.cli import main; main()"
    subprocess.run([sys.executable, "-c", code, "new-method", "knn"], cwd=place, check=True)
    packages = [place / name for name in PACKAGES]
    subprocess.run([*PIP, "--target", place / "site", *packages], check=True)
    return place / "site"


@pytest.fixture
def site(installed, monkeypatch):
    """That folder, which Python imports from until the test ends."""
    monkeypatch.syspath_prepend(str(installed))
    monkeypatch.setenv("BENCH_JOBS", "1")
    yield installed
    forget()


def forget():
    """Makes this process forget the packages, as a new one would not know them."""
    registry.get_method.cache_clear()
    importlib.invalidate_caches()
    for name in PACKAGES:
        sys.modules.pop(name, None)


@pytest.fixture
def row(site, reference, bench):
    """Ships a reference, runs a method of a package like it, and returns its submitted row."""
    reference()

    def submit(method):
        chosen = ("--experiments", "success", "--tasks", "door", "--methods", method)
        code, said, error = bench("run", "paper", *chosen, "--seeds", "2", "--out", method)
        assert code == 0, said + error
        forget()
        code, said, error = bench("submit", method, "--out", f"{method}.parquet")
        assert code == 0, said + error
        return Path(f"{method}.parquet")

    return submit


def test_a_row_of_the_example_package_is_submitted_and_repeated_bit_by_bit(task, row, bench):
    file = row("copycat")
    assert "copycat" not in sys.modules
    origin = Submission(file).origin
    assert (origin.method, origin.version, origin.package.name) == ("copycat", 1, "copycat")
    assert list(origin.package.files) == ["copycat.py"]
    code, said, _ = bench("verify", str(file), "--cells", "9")
    assert code == 0
    assert said.count("identical: door-copycat-described-single-n6-s") == 2
    assert said.endswith(f"sha256 of copycat.parquet: {Submission(file).digest}\n")


def test_changes_that_no_digest_shows_are_found_by_repeating(task, row, bench):
    file = row("copycat")
    honest = file.read_bytes()
    for change in (flip_and_count, swap_seeds_and_keys):
        file.write_bytes(honest)
        reseal(file, change)
        code, said, error = bench("verify", str(file), "--cells", "9")
        assert code == 3, error
        assert "different bits: door-copycat-described-single-n6-s1" in said
        assert "sha256" not in said


def test_a_row_of_another_controller_in_the_guise_of_the_shipped_one_is_found_by_repeating(
    task, row, bench, paper, monkeypatch
):
    file = row("knn")
    honest = record_of(file)
    shutil.rmtree("knn")

    def disguise(record, episodes):
        record["controllers"] = honest["controllers"]
        for mine, theirs in zip(record["evaluations"], honest["evaluations"], strict=True):
            mine["controller_key"] = theirs["controller_key"]
        return episodes

    with monkeypatch.context() as patch:
        patch.setitem(PRESETS, "paper", replace(paper, controller=ControllerConfig(epochs=9)))
        patch.setattr("reports.submitting.other_protocols", lambda *arguments: None)
        patch.setattr("reports.submitting.check_comparable", lambda *arguments: None)
        row("knn")
    reseal(file, disguise)
    code, said, error = bench("verify", str(file), "--cells", "9")
    assert code == 3, error
    assert said.count("different bits: door-knn-described") == 2


def test_the_page_on_submitting_runs(task, site, reference, paper, bench, monkeypatch):
    monkeypatch.setitem(PRESETS, "paper", replace(paper, tasks=("door",)))
    reference(episodes={"success": 12, "ood": 12}, seeds=(1, 2, 3))
    for block in re.findall(r"^```sh\n(.*?)```", DOCS.read_text(), re.DOTALL | re.MULTILINE):
        for line in block.splitlines():
            forget()
            code, said, error = bench(*shlex.split(line)[1:])
            assert code == 0, (line, said + error)
    assert Path("knn.parquet").exists()
