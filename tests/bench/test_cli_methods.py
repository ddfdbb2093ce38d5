"""A method of one's own, from `bench new-method` to the report, in a package that pip installs."""

import importlib
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from methods import registry

ROOT = Path(__file__).parents[2]


def tutorial(number):
    """Returns the commands of the tutorial's block of that number, as words."""
    page = (ROOT / "docs/add_a_method.md").read_text()
    return [
        line.split() for line in re.findall(r"```sh\n(.*?)```", page, re.S)[number].splitlines()
    ]


@pytest.mark.parametrize("task", ["door"], indirect=True)
@pytest.mark.parametrize(("number", "name"), [(0, "mine"), (1, "bc")])
def test_the_tutorial_leads_from_nothing_to_a_row_in_the_table(
    number, name, task, smoke, bench, tmp_path, monkeypatch
):
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    site = tmp_path / "site"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BENCH_JOBS", "1")
    monkeypatch.syspath_prepend(str(site))
    try:
        for command, *words in tutorial(number):
            if command == "pip":
                package = shutil.copytree(words[-1], tmp_path / "package")
                subprocess.run([*pip, "--target", str(site), str(package)], check=True)
                importlib.invalidate_caches()
                registry.get_method.cache_clear()
            else:
                code, said, error = bench(*words)
                assert code == 0, said + error
        assert name in bench("list")[1]
        table = pd.read_csv(f"results/{name}/report/tables/unseen.csv")
        assert set(table.row) == {"expert", "kodex", name}
    finally:
        registry.get_method.cache_clear()
        sys.modules.pop(name, None)


def test_new_method_says_what_to_do_next(bench, tmp_path):
    _, said, _ = bench("new-method", "mine", "--folder", str(tmp_path))
    assert f"pip install -e {tmp_path / 'mine'} && bench check mine" in said


@pytest.mark.parametrize(
    "name",
    [
        *("my method", "Mine", "kodex", "1st", "_x", "methodé", "x" * 41, "a\nb"),
        *("class", "none", "expert", "validation", "random", "numpy", "torch", "setuptools"),
        *("methods", "bench", "door", "paper", "audit"),
    ],
)
def test_names_that_will_not_do_are_refused(bench, tmp_path, name):
    code, _, error = bench("new-method", name, "--folder", str(tmp_path))
    assert code == 2
    assert f"a method cannot be called {name!r}" in error
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(bench, tmp_path):
    (tmp_path / "mine").mkdir()
    code, _, error = bench("new-method", "mine", "--folder", str(tmp_path))
    assert code == 2
    assert "exists already" in error


def test_a_package_that_cannot_be_written_leaves_nothing(bench, tmp_path, monkeypatch):
    def fail(*arguments):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_text", fail)
        with pytest.raises(OSError, match="No space left"):
            bench("new-method", "mine", "--folder", str(tmp_path / "new"))
    assert list(tmp_path.iterdir()) == []
    assert bench("new-method", "mine", "--folder", str(tmp_path / "new"))[0] == 0


def test_check_names_the_rules_and_says_what_they_ask(bench):
    code, said, _ = bench("check", "kodex")
    assert code == 0
    assert "ok     begins_at_the_start: The first row of a motion is its start." in said


def test_an_unknown_method_is_refused(bench):
    code, _, error = bench("check", "kodx")
    assert code == 2
    assert "did you mean 'kodex'" in error
