"""A user's method, from `bench new-method` to the report, in a package that pip installs."""

import importlib
import json
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pandas as pd
import pytest

from methods import registry
from methods.checks import RULES, check
from tasks.errors import InputError

ROOT = Path(__file__).parents[2]


PAGE = (ROOT / "docs/add_a_method.md").read_text()
PIP = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]


def fenced(kind, *sections):
    """Returns the blocks of a kind, such as sh, in sections of the tutorial."""
    parts = re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", PAGE, re.M | re.S)
    text = "".join(part for title, part in parts if title in sections)
    return [block for name, block in re.findall(r"```(\w*)\n(.*?)```", text, re.S) if name == kind]


def shapes(text):
    """Returns the lines of a text with the numbers masked."""
    return [" ".join(re.sub(r"[-+]?\d+(\.\d+)?", "#", line).split()) for line in text.splitlines()]


@pytest.fixture
def follow(reference, bench, tmp_path, monkeypatch):
    """Runs the shell blocks of sections; returns their output."""
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
    for name in {"knn", "copycat"} & (set(sys.modules) - known):
        del sys.modules[name]


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_the_tutorial_runs_from_new_method_to_the_tables(task, follow):
    said = shapes(follow("From nothing to a number"))
    (shown,) = fenced("", "From nothing to a number")
    first = said.index(shapes(shown)[0])
    assert len(said[first:]) > 5
    assert set(said[first:]) <= set(shapes(shown))
    follow("From a number to the tables")
    table = pd.read_csv("results/knn/report/tables/success.csv")
    assert set(table.row) == {"expert", "kodex", "nn", "knn"}
    (code,) = fenced("python", "In a test of your own")
    written = {}
    exec(compile(code, "add_a_method.md", "exec"), written)
    for rule in RULES:
        written["test_it_keeps_the_contract"](rule)
    (code,) = fenced("python", "A method that predicts anew")
    exec(compile(code, "add_a_method.md", "exec"), written)
    broken = [result for result in check(written["Onward"]) if not result.passed]
    assert not broken


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_closed_loop_method_is_tried_as_the_tutorial_shows(task, follow):
    said = follow("A closed-loop method")
    (shown,) = fenced("", "A closed-loop method")
    alone = shown.replace("copycat, BC, Chunk, Flow;", "copycat;")
    assert set(shapes(said)) <= set(shapes(alone))
    assert "seen by copycat; the others" in said


def test_new_method_says_what_to_do_next(bench, tmp_path):
    _, said, _ = bench("new-method", "mine", "--folder", str(tmp_path))
    assert f"pip install -e {tmp_path / 'mine'} && bench check mine && bench try mine" in said


def test_a_new_method_refuses_to_average_no_neighbours(bench, tmp_path, monkeypatch):
    bench("new-method", "averaging", "--folder", str(tmp_path))
    monkeypatch.syspath_prepend(str(tmp_path / "averaging"))
    config = importlib.import_module("averaging").AveragingConfig
    del sys.modules["averaging"]
    assert config(neighbours=3).neighbours == 3
    with pytest.raises(InputError, match="neighbours must be above 0, got 0"):
        config(neighbours=0)


@pytest.mark.parametrize(
    "name",
    [
        *("my method", "Mine", "kodex", "1st", "_x", "methodé", "x" * 41, "a\nb"),
        *("class", "none", "expert", "validation", "random", "numpy", "torch", "setuptools"),
        *("methods", "bench", "door", "paper", "audit"),
    ],
)
def test_new_method_refuses_unusable_names(bench, tmp_path, name):
    code, _, error = bench("new-method", name, "--folder", str(tmp_path))
    assert code == 2
    assert f"a method cannot be called {name!r}" in error
    assert list(tmp_path.iterdir()) == []


def test_new_method_overwrites_nothing(bench, tmp_path):
    (tmp_path / "mine").mkdir()
    code, _, error = bench("new-method", "mine", "--folder", str(tmp_path))
    assert code == 2
    assert "exists already" in error


def test_new_method_leaves_nothing_if_writing_fails(bench, tmp_path, monkeypatch):
    def fail(*arguments):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_text", fail)
        with pytest.raises(OSError, match="No space left"):
            bench("new-method", "mine", "--folder", str(tmp_path / "new"))
    assert list(tmp_path.iterdir()) == []
    assert bench("new-method", "mine", "--folder", str(tmp_path / "new"))[0] == 0


def test_check_prints_the_number_and_names_of_the_rules_that_hold(bench):
    code, said, _ = bench("check", "nn")
    assert code == 0
    assert said.startswith("nn: 21 of 21 rules hold for each of 2 variants, ")
    assert "ok     declared, unfitted_raises, fits, answers, finite, begins_at_the_start" in said


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Installs a package of one method, an altered KODex, from the text of its class."""
    site = tmp_path / "site"
    monkeypatch.syspath_prepend(str(site))
    registry.get_method.cache_clear()

    def install(body):
        info = site / "altered-0.1.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: altered\nVersion: 0.1\n")
        (info / "entry_points.txt").write_text("[bench.methods]\naltered = altered:Altered\n")
        (site / "altered.py").write_text(ALTERED + textwrap.indent(body, "    "))
        importlib.invalidate_caches()

    yield install
    registry.get_method.cache_clear()


ALTERED = """
import ctypes
import os
from dataclasses import replace
from methods.kodex import Kodex

print("imported")


class Altered(Kodex):
    name = "altered"
    sizes = {"single": replace(Kodex.sizes["single"], observables=1)}
    variants = {"described": {}}
"""


def test_check_prints_each_broken_rule_once_with_its_line(bench, package):
    package("def fit(self, demos, validation, seed):\n    {}['learning_rate']\n")
    code, said, _ = bench("check", "altered")
    assert code == 3
    assert said.count("BROKEN") == 1
    assert "BROKEN fits: fit raised KeyError: 'learning_rate' (altered.py:" in said
    assert "not tried: 18 rules (needs fits)" in said
    code, said, _ = bench("check", "altered", "--json")
    assert [one["rule"] for one in json.loads(said) if one["tried"]] == [
        *("declared", "unfitted_raises", "fits")
    ]


def test_check_names_the_variant_that_breaks_a_rule(bench, package):
    package(
        "variants = {'described': {}, 'second': {'observables': 2}}\n"
        "def fit(self, demos, validation, seed):\n"
        "    assert self.config.observables == 1\n"
        "    super().fit(demos, validation, seed)\n"
    )
    code, said, _ = bench("check", "altered")
    assert code == 3
    assert said.startswith("altered: 2 of 21 rules hold for each of 2 variants, ")
    assert "BROKEN fits (second): fit raised AssertionError (altered.py:" in said
    assert "not tried: 18 rules (needs fits)" in said
    rows = json.loads(bench("check", "altered", "--json")[1])
    assert all(row["passed"] for row in rows if row["variant"] == "described")


def test_check_names_a_method_that_depends_on_the_hashes_of_texts(bench, package):
    package(
        "def rollout(self, start, steps):\n"
        "    motion = super().rollout(start, steps)\n"
        "    motion[:, 1:] += 1e-9 * (hash('door') % 2**20)\n"
        "    return motion\n"
    )
    code, said, _ = bench("check", "altered")
    assert code == 3
    assert said.count("BROKEN") == 1
    assert "BROKEN survives_another_process: it answers differently once loaded in" in said
    assert "nothing may depend on hash()" in said


def test_check_counts_the_lines_a_method_prints_and_shows_the_first(bench, package):
    package(
        "def rollout(self, start, steps):\n"
        "    ctypes.CDLL(None).puts(b'told by C')\n"
        "    print('one\\n' * 100)\n"
        "    return super().rollout(start, steps)\n"
    )
    code, said, error = bench("check", "altered")
    assert (code, error) == (0, "")
    assert re.search(r"It printed [\d,]{4,} lines; the first are:\n       \| imported\n", said)
    assert said.count("one\n") <= 3


def test_an_unknown_method_is_refused(bench):
    code, _, error = bench("check", "kodx")
    assert code == 2
    assert "did you mean 'kodex'" in error
