"""The source of a method's package, read without importing it."""

import importlib
import sys

import pytest

from bench.package_source import package_source
from tasks.errors import InputError


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of two modules that is installed beside others, and cannot be imported."""
    monkeypatch.syspath_prepend(str(tmp_path))
    info = tmp_path / "two_parts-0.3.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: two-parts\nVersion: 0.3\n")
    (info / "entry_points.txt").write_text("[bench.methods]\nparted = parted.main:Parted\n")
    (info / "top_level.txt").write_text("parted\nparted_tools\n")
    for name in ("parted/__init__.py", "parted/main.py", "parted/data/a.json", "parted_tools.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("raise SystemExit\n")
    importlib.invalidate_caches()
    return tmp_path


def test_every_module_of_the_package_counts_and_none_is_imported(package):
    found = package_source("parted")
    assert (found.name, found.version) == ("two-parts", "0.3")
    files = {"parted/__init__.py", "parted/main.py", "parted/data/a.json", "parted_tools.py"}
    assert set(found.files) == files
    assert not {"parted", "parted.main", "parted_tools"} & set(sys.modules)


def test_the_first_file_that_differs_is_named(package):
    before = package_source("parted")
    for hidden in ("parted/.cache/x", "parted/__pycache__/main.pyc"):
        (package / hidden).parent.mkdir()
        (package / hidden).write_text("")
    assert before.difference(package_source("parted")) == ""
    (package / "parted/main.py").write_text("")
    assert before.difference(package_source("parted")) == "parted/main.py"
    (package / "parted/extra.py").write_text("")
    assert before.difference(package_source("parted")) == "parted/extra.py"


def test_a_package_whose_module_is_gone_is_refused(package):
    (package / "parted_tools.py").unlink()
    with pytest.raises(InputError, match=r"source of two-parts cannot be read: .*parted_tools"):
        package_source("parted")
    with pytest.raises(InputError, match=r"unknown method 'party'.*did you mean 'parted'"):
        package_source("party")
