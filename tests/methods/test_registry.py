"""Methods of packages: folders on the path with the metadata that pip would write."""

import importlib
import json
import sys
from pathlib import Path

import pytest

from bench.runner import Outcome
from methods import registry
from methods.registry import SUITE, get_method, method_names, unusable
from tasks.errors import InputError
from tasks.packages import PackageError

METHOD = """
from methods.kodex import Kodex

class {0}(Kodex):
    name = "{1}"
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Installs a package with entry points and modules."""
    monkeypatch.syspath_prepend(str(tmp_path))
    made = []

    def write(package, points, **modules):
        noted = tmp_path / f"{package}-1.0.dist-info"
        noted.mkdir()
        (noted / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (noted / "entry_points.txt").write_bytes(b"[bench.methods]\n" + points.encode("latin-1"))
        for name, text in modules.items():
            (tmp_path / f"{name}.py").write_text(text)
            made.append(name)
        importlib.invalidate_caches()
        registry.get_method.cache_clear()

    yield write
    registry.get_method.cache_clear()
    for name in made:
        sys.modules.pop(name, None)


def test_a_method_of_a_package_is_listed_after_those_of_the_suite(install):
    install("good", "good = good:Good", good=METHOD.format("Good", "good"))
    assert method_names() == [*SUITE, "good"]
    assert get_method("good").name == "good"
    assert unusable() == {}


@pytest.mark.parametrize(
    "name", ["expert", "validation", "none", "bench", "random", "class", "w/o"]
)
def test_a_reserved_name_is_refused_with_its_package(install, bench, name):
    install("evil", f"{name} = evil:Evil", evil=METHOD.format("Evil", name))
    assert name not in method_names()
    reason = unusable()[name]
    for answer in (
        "evil provides a method",
        f"cannot be called '{name}'",
        "rename its entry point",
    ):
        assert answer in reason
    with pytest.raises(PackageError) as refused:
        get_method(name)
    assert str(refused.value) == reason
    for command in ("check", "describe"):
        code, _, error = bench(command, name)
        assert (code, error) == (2, f"bench: {reason}\n")


def test_a_package_does_not_replace_a_method_of_the_suite(install, bench, monkeypatch):
    install("evil", "kodex = evil:Evil", evil=METHOD.format("Evil", "kodex"))
    assert method_names().count("kodex") == 1
    for variant in ("described", "set_1"):
        assert get_method("kodex", variant).__module__ == "methods.kodex"
    monkeypatch.setattr("bench.driver.run", lambda *arguments: Outcome(Path(), 0, 0, ()))
    code, _, error = bench("run", "smoke", "--methods", "kodex", "--out", "out")
    assert code == 0
    assert "evil provides a method 'kodex', which this suite has" in error
    assert "the suite's own is used" in error


def test_two_packages_with_the_same_method_are_both_named(install):
    install("first", "same = first:Same", first=METHOD.format("Same", "same"))
    install("second", "same = second:Same", second=METHOD.format("Same", "same"))
    assert "same" not in method_names()
    with pytest.raises(PackageError, match="first and second provide the same method 'same'"):
        get_method("same")


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ("import nowhere", r"ModuleNotFoundError: No module named 'nowhere' \(broken.py:1\)"),
        ("\nx = (", r"SyntaxError: .* \(broken.py:2\)"),
        ("raise SystemExit(3)", r"SystemExit: 3 \(broken.py:1\)"),
        ("raise KeyboardInterrupt", r"KeyboardInterrupt \(broken.py:1\)"),
        ("{}['x']", r"KeyError: 'x' \(broken.py:1\)"),
        ("x = 1", "AttributeError: module 'broken' has no attribute 'Broken'"),
        (
            "class E(BaseException):\n  def __str__(self): raise SystemExit\nraise E",
            r"E: its message cannot be shown \(broken.py:3\)",
        ),
    ],
)
def test_a_failed_import_of_a_method_is_reported_in_one_line(install, bench, text, answer):
    install("evil", "broken = broken:Broken", broken=text)
    with pytest.raises(
        PackageError, match=rf"'broken' \(broken:Broken\) of evil cannot be imported: {answer};"
    ):
        get_method("broken")
    code, said, error = bench("check", "broken")
    assert (code, said, error.count("\n")) == (2, "", 1)
    rows = json.loads(bench("doctor", "--json")[1])
    (advice,) = [row["advice"] for row in rows if row["what"] == "method 'broken'"]
    assert "cannot be imported" in advice


@pytest.mark.parametrize(
    ("value", "text", "answer"),
    [
        ("bad:f", "def f(): pass", "used: it must be a subclass of MotionMethod or ActionMethod"),
        ("bad:Bad", METHOD.format("Bad", "other"), "used: the class must have the name 'bad'"),
        (
            "bad:Bad",
            METHOD.format("Bad", "bad") + "    sizes = {'w/o': 1}",
            "used: a size cannot be",
        ),
        (
            "bad:Bad",
            METHOD.format("Bad", "bad") + "    sizes = ['one']",
            "used: sizes must be a dict",
        ),
        (
            "bad:Bad",
            METHOD.format("Bad", "bad") + "    variants = {'a b': {}}",
            "used: a variant cannot",
        ),
        ("not a value", "", "imported: (AttributeError|ValueError)"),
        ("nowhere:Bad", "", "imported: ModuleNotFoundError"),
    ],
)
def test_an_entry_point_that_is_not_a_valid_method_is_refused(install, value, text, answer):
    install("evil", f"bad = {value}", bad=text)
    with pytest.raises(PackageError, match=rf"method 'bad' \({value}\) of evil cannot be {answer}"):
        get_method("bad")


def test_doctor_and_list_say_why_methods_are_unusable(install, bench):
    install("evil", "expert = evil:Evil", evil=METHOD.format("Evil", "expert"))
    rows = {row["what"]: row for row in json.loads(bench("doctor", "--json")[1])}
    assert rows["method 'expert'"]["found"] == "unusable"
    assert "uninstall evil" in rows["method 'expert'"]["advice"]
    assert "unusable: evil provides a method that cannot be used" in bench("list")[1]


@pytest.mark.parametrize("points", ["nonsense", "\xff = a:b"])
def test_unreadable_entry_points_are_left_out(install, bench, points):
    install("evil", points)
    install("good", "good = good:Good", good=METHOD.format("Good", "good"))
    assert method_names()[-1] == "good"
    rows = {row["what"]: row for row in json.loads(bench("doctor", "--json")[1])}
    assert "cannot be read" in rows["package 'evil'"]["advice"]


def test_an_unknown_method_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match="did you mean 'kodex'"):
        get_method("kodx")
