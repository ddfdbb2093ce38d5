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
from methods.checks import RULES

ROOT = Path(__file__).parents[2]


PAGE = (ROOT / "docs/add_a_method.md").read_text()
PIP = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]


def fenced(kind, *sections):
    """Returns the blocks of a kind, such as sh, in sections of the tutorial."""
    parts = re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", PAGE, re.M | re.S)
    text = "".join(part for title, part in parts if title in sections)
    return [block for name, block in re.findall(r"```(\w*)\n(.*?)```", text, re.S) if name == kind]


def shapes(text):
    """Returns the lines of a text without the values of their numbers."""
    return [" ".join(re.sub(r"[-+]?\d+(\.\d+)?", "#", line).split()) for line in text.splitlines()]


@pytest.fixture
def follow(reference, bench, tmp_path, monkeypatch):
    """Does what the shell blocks of sections say; returns what was printed."""
    reference(episodes={"success": 200})
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    site = tmp_path / "site"
    monkeypatch.setenv("BENCH_JOBS", "1")
    monkeypatch.syspath_prepend(str(site))
    known = set(sys.modules)

    def install(package):
        copy = shutil.copytree(package, tmp_path / "packages" / Path(package).name)
        subprocess.run([*PIP, "--target", str(site), str(copy)], check=True)
        importlib.invalidate_caches()
        registry.get_method.cache_clear()

    def run(*sections):
        printed = ""
        for line in "".join(fenced("sh", *sections)).splitlines():
            command, *words = line.split()
            if command == "pip":
                install(words[-1])
            else:
                code, said, error = bench(*words)
                assert code == 0, said + error
                printed += said
        return printed

    yield run
    registry.get_method.cache_clear()
    for name in {"knn", "bc"} & (set(sys.modules) - known):
        del sys.modules[name]


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_the_tutorial_leads_from_nothing_to_a_number_and_to_the_tables(task, follow):
    said = shapes(follow("From nothing to a number"))
    (shown,) = fenced("", "From nothing to a number")
    first = said.index(shapes(shown)[0])
    assert len(said[first:]) > 5
    assert set(said[first:]) <= set(shapes(shown))
    follow("From a number to the tables")
    table = pd.read_csv("results/knn/report/tables/unseen.csv")
    assert set(table.row) == {"expert", "kodex", "nn", "knn"}
    (code,) = fenced("python", "In a test of your own")
    written = {}
    exec(compile(code, "add_a_method.md", "exec"), written)
    for rule in RULES:
        written["test_it_keeps_the_contract"](rule)


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_closed_loop_method_is_tried_as_the_tutorial_shows(task, follow):
    said = follow("A closed-loop method")
    (shown,) = fenced("", "A closed-loop method")
    assert set(shapes(said)) <= set(shapes(shown))
    assert "bc sees every state" in said


def test_new_method_says_what_to_do_next(bench, tmp_path):
    _, said, _ = bench("new-method", "mine", "--folder", str(tmp_path))
    assert f"pip install -e {tmp_path / 'mine'} && bench check mine && bench try mine" in said


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
