"""The release: `make release` builds it and tests it in new environments."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
pytestmark = [pytest.mark.release, pytest.mark.timeout(0)]


def call(*words, **options):
    subprocess.run([str(word) for word in words], check=True, **options)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A folder with the sdist of tracked files, and the wheel that is built from it."""
    source, dist = (tmp_path_factory.mktemp(name) for name in ("source", "dist"))
    call("git", "clone", "--quiet", ROOT, source)
    call(sys.executable, "-m", "build", "--outdir", dist, source)
    return dist


def test_the_wheel_holds_all_packages_and_their_data(built):
    (wheel,) = built.glob("*.whl")
    held = set(zipfile.ZipFile(wheel).namelist())
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    folders = ("bench/", "methods/", "reports/", "tasks/")
    wanted = {name for name in tracked.stdout.splitlines() if name.startswith(folders)}
    assert wanted - held == set()
    assert not [name for name in held if name.startswith(("tests/", "benchmarks/", "docs/"))]


@pytest.mark.parametrize("kind", ["*.whl", "*.tar.gz"])
def test_the_wheel_runs_in_an_empty_environment(built, kind, tmp_path):
    (package,) = built.glob(kind)
    call(sys.executable, "-m", "venv", tmp_path / "venv")
    bin_ = tmp_path / "venv/bin"
    call(bin_ / "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", package)
    environment = os.environ | {"BENCH_CACHE": str(tmp_path / "cache")}
    environment.pop("PYTHONPATH", None)
    for words in (
        "list",
        "run smoke --methods kodex --out results",
        "report results",
        "report --reference --out reference",
    ):
        call(bin_ / "bench", *words.split(), cwd=tmp_path, env=environment)
    for page in ("results/report/index.html", "reference/index.html"):
        assert (tmp_path / page).stat().st_size > 10_000
