"""`bench submit` and `bench verify FILE`: rows of packages beside a small reference."""

import importlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from bench.names import KEY_DIGITS, fit_key
from bench.sealed_files import seal_table
from bench.source import FIT_FIELDS
from bench.submission import LABEL, Submission
from methods import registry
from reports import submitted_rows
from tasks.registry import TASKS

EXAMPLE = Path(__file__).parents[2] / "docs/examples/copycat"
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
def site(installed, tmp_path, monkeypatch):
    """A copy of that folder that Python imports from, until the test ends."""
    copy = shutil.copytree(installed, tmp_path / "site")
    monkeypatch.syspath_prepend(str(copy))
    monkeypatch.setenv("BENCH_JOBS", "1")
    yield copy
    forget()


def forget():
    """Makes this process forget the packages, as a new one would not know them."""
    registry.get_method.cache_clear()
    importlib.invalidate_caches()
    for name in PACKAGES:
        sys.modules.pop(name, None)


@pytest.fixture
def run(site, reference, bench):
    """Runs a method of a package like the reference, which it ships before."""
    reference()

    def run_method(method, *options):
        chosen = ("--experiments", "success", "--tasks", "door", "--methods", method)
        seeds = () if "--seeds" in options else ("--seeds", "2")
        code, said, error = bench("run", "paper", *chosen, *seeds, *options, "--out", method)
        assert code == 0, said + error
        forget()

    return run_method


@pytest.fixture
def row(run, bench):
    """Submits a method of a package; returns the file."""

    def submit(method):
        run(method)
        code, said, error = bench("submit", method, "--out", f"{method}.parquet")
        assert code == 0, said + error
        return Path(f"{method}.parquet")

    return submit


def test_a_row_of_the_example_package_is_submitted_verified_and_shown(task, row, bench):
    file = row("copycat")
    assert "copycat" not in sys.modules
    code, said, _ = bench("verify", str(file), "--cells", "9")
    digest = Submission(file).digest
    assert code == 0
    assert said.count("identical: door-copycat-described-single-n6-s") == 2
    assert said.endswith(f"sha256 of copycat.parquet: {digest}\n")
