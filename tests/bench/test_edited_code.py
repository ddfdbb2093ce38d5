"""Stored results of a package whose code has changed since."""

import importlib
import sys

import pytest

from bench.package_source import code_of
from bench.results import Results
from methods import registry

POINTS = "[bench.methods]\nedited = edited:Edited\n[bench.tasks]\nplace = edited:Place\n"
METHOD = """
from dataclasses import replace
from methods.kodex import Kodex


class Edited(Kodex):
    name = "edited"
    version = {version}  # {note}
    sizes = {{"single": replace(Kodex.sizes["single"], observables=1)}}
    variants = {{"described": {{}}}}
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Installs a method of a package, or another state of it; returns its folder."""
    site = tmp_path / "site"
    info = site / "edited-0.1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: edited\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text(POINTS)
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def write(**values):
        (site / "edited.py").write_text(METHOD.format(**values))
        forget()
        return site

    yield write
    forget()


def forget():
    sys.modules.pop("edited", None)
    registry.get_method.cache_clear()
    importlib.invalidate_caches()


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_run_and_status_say_that_code_has_changed_until_the_version_is_raised(
    task, smoke, bench, install, tmp_path
):
    out = tmp_path / "results"
    words = f"run smoke --tasks door --methods edited --jobs 1 --out {out}".split()

    def said():
        code, _, errors = bench(*words, "--experiments", "success")
        assert code == 0, errors
        noted = [line for line in errors.splitlines() if line.startswith("note: ")]
        code, printed, _ = bench("status", str(out))
        assert [line for line in printed.splitlines() if line.startswith("note: ")] == noted
        return noted

    install(version=1, note="slow")
    assert said() == []
    before = Results(out).frame()
    install(version=1, note="fast")
    assert said() == [
        "note: the code of edited has changed since 1 stored evaluation of it was computed: if it"
        " now gives other results, raise `version` in its class and run again"
    ]
    assert Results(out).frame().equals(before)
    install(version=2, note="fast")
    assert said() == []


def test_code_is_that_of_the_python_files_of_a_package(install):
    site = install(version=1, note="slow")
    first = code_of("edited", "place", "kodex", "door", "unknown")
    assert sorted(first) == ["edited", "place"]
    (site / "notes.txt").write_text("data")
    assert code_of("edited", "place") == first
    install(version=1, note="fast")
    assert not code_of("edited", "place").items() & first.items()
