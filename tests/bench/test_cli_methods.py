"""A method of one's own, from `bench new-method` to the report, in a package that pip installs."""

import json
import subprocess
import sys

import pytest

from bench.store import Store
from methods import registry


@pytest.fixture
def installed(bench, tmp_path, monkeypatch):
    """The package that `bench new-method` writes, installed into a folder of its own."""
    code, said, _ = bench("new-method", "mine", "--folder", str(tmp_path))
    assert code == 0
    assert f"pip install -e {tmp_path / 'mine'} && bench check mine" in said
    site = tmp_path / "site"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*pip, "--target", str(site), str(tmp_path / "mine")], check=True)
    monkeypatch.syspath_prepend(str(site))
    registry.get_method.cache_clear()
    yield tmp_path / "mine"
    registry.get_method.cache_clear()


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_new_method_is_checked_run_and_reported(installed, task, smoke, bench, tmp_path):
    code, said, _ = bench("check", "mine", "--json")
    assert code == 0, said
    assert all(verdict["passed"] for verdict in json.loads(said))
    assert "mine" in bench("list")[1]
    out = tmp_path / "results"
    options = ("--methods", "mine", "--out", str(out), "--jobs", "1")
    code, _, error = bench("run", "smoke", *options)
    assert code == 0, error
    assert "mine" in set(Store(out).frame().method)
    assert bench("report", str(out))[0] == 0


@pytest.mark.parametrize("name", ["my method", "Mine", "kodex", "1st"])
def test_names_that_will_not_do_are_refused(bench, tmp_path, name):
    code, _, error = bench("new-method", name, "--folder", str(tmp_path))
    assert code == 2
    assert name in error
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(bench, tmp_path):
    (tmp_path / "mine").mkdir()
    code, _, error = bench("new-method", "mine", "--folder", str(tmp_path))
    assert code == 2
    assert "exists already" in error


def test_check_names_the_rules_and_says_what_they_ask(bench):
    code, said, _ = bench("check", "kodex")
    assert code == 0
    assert "ok     begins_at_the_start: The first row of a motion is its start." in said


def test_an_unknown_method_is_refused(bench):
    code, _, error = bench("check", "kodx")
    assert code == 2
    assert "did you mean 'kodex'" in error
