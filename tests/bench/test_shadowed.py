"""A module elsewhere with the name of one of our packages, in a separate process."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import bench

ROOT = Path(bench.__file__).parents[1]
STATEMENTS = {
    "a function": "import bench; bench.load('results')",
    "a module": "import bench.results",
    "a name": "from bench.presets import Study",
}


def run(folder, *command, beside=ROOT):
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (folder, beside)))}
    return subprocess.run(
        [sys.executable, *command],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
    )


@pytest.fixture(params=["tasks.py", "methods.py", "reports.py", "tasks/__init__.py"])
def shadow(request, tmp_path):
    path = tmp_path / request.param
    path.parent.mkdir(exist_ok=True)
    path.write_text("raise RuntimeError('this must not be imported')")
    return path


@pytest.mark.parametrize(
    "command", [("-c", "from bench.cli import main; main()"), ("-m", "bench.cli")]
)
def test_the_command_line_names_the_file_in_the_way(shadow, tmp_path, command):
    done = run(tmp_path, *command, "list")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"bench: {shadow} is in the way of the package ")
    assert "take its folder off PYTHONPATH" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("statement", STATEMENTS.values(), ids=STATEMENTS)
def test_importing_a_module_of_bench_names_the_file_in_the_way(shadow, tmp_path, statement):
    done = run(tmp_path, "-c", statement)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(f"ImportError: {shadow} is in the way")


def test_folders_without_a_module_are_not_in_the_way(tmp_path):
    for name in ("tasks", "methods", "reports"):
        (tmp_path / name).mkdir()
    assert run(tmp_path, "-c", "import bench.presets").returncode == 0


def test_a_link_to_the_suite_is_not_in_the_way(tmp_path):
    (tmp_path / "link").symlink_to(ROOT)
    done = run(tmp_path, "-c", "import bench.presets", beside=tmp_path / "link")
    assert done.returncode == 0, done.stderr


def test_each_package_may_be_a_link_of_its_own(tmp_path):
    for name in ("bench", "methods", "tasks", "reports"):
        (tmp_path / name).mkdir()
        for path in (ROOT / name).iterdir():
            (tmp_path / name / path.name).symlink_to(path)
    done = run(tmp_path, "-c", "import bench.presets", beside="")
    assert done.returncode == 0, done.stderr
