import importlib

import pytest

from tasks.errors import LONGEST, described, unknown_name


def caught(call, *arguments):
    try:
        call(*arguments)
    except BaseException as error:
        return error
    raise AssertionError("nothing was raised")


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Writes a module and returns the error that its import raises."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(text, file="broken_module.py"):
        path = tmp_path / file
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        importlib.invalidate_caches()
        return caught(importlib.import_module, "broken_module")

    return write


def test_an_error_is_described_with_its_place():
    def fit():
        {}["x"]

    line = fit.__code__.co_firstlineno + 1
    assert described(caught(fit)) == f"KeyError: 'x' (test_errors.py:{line} in fit)"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("\nimport nowhere", "ModuleNotFoundError: No module named 'nowhere' (broken_module.py:2)"),
        ("x = 1\n?", "SyntaxError: invalid syntax (broken_module.py:2)"),
        ("x = 1\n  y = 2", "IndentationError: unexpected indent (broken_module.py:2)"),
        ("raise SystemExit(4)", "SystemExit: 4 (broken_module.py:1)"),
        ("raise KeyboardInterrupt", "KeyboardInterrupt (broken_module.py:1)"),
        ("def f():\n  1 / 0\nf()", "ZeroDivisionError: division by zero (broken_module.py:2 in f)"),
    ],
)
def test_a_failed_import_is_described_with_the_module_and_line(module, text, line):
    assert described(module(text)) == line


def test_an_error_in_a_package_is_described_with_its_folder(module):
    error = module("raise ValueError(1)", "broken_module/__init__.py")
    assert described(error) == "ValueError: 1 (broken_module/__init__.py:1)"


def test_frames_of_importlib_are_not_the_place():
    error = caught(importlib.import_module, "nowhere")
    assert described(error) == "ModuleNotFoundError: No module named 'nowhere'"


def test_an_error_that_was_never_raised_has_no_place():
    assert described(ValueError("bad")) == "ValueError: bad"
    assert described(ValueError()) == "ValueError"


def test_a_description_is_one_printable_line():
    text = "a\nb\x1b[31m\ud800\u2028é"
    assert described(ValueError(text)) == r"ValueError: a\nb\x1b[31m\ud800\u2028é"


@pytest.mark.parametrize("error", [ValueError("x" * 10**6), ValueError("\n" * 10**6)])
def test_a_long_message_is_cut_and_keeps_the_place(error):
    def fail():
        raise error

    said = described(caught(fail))
    assert len(said) == LONGEST
    assert said.endswith(f"... (test_errors.py:{fail.__code__.co_firstlineno + 1} in fail)")


class OddError(Exception):
    """An error whose message raises, or is not a plain text."""

    def __init__(self, raised):
        self.raised = raised

    def __str__(self):
        if isinstance(self.raised, BaseException):
            raise self.raised
        return self.raised


class Text(str):
    def __getitem__(self, rows):
        raise RuntimeError

    __iter__ = __len__ = __getitem__


@pytest.mark.parametrize("raised", [SystemExit(1), KeyboardInterrupt(), RecursionError(), 3])
def test_an_error_whose_message_raises_is_described_without_it(raised):
    assert described(OddError(raised)) == "OddError: its message cannot be shown"


def test_a_message_of_a_str_subclass_is_described():
    assert described(OddError(Text("plain"))) == "OddError: plain"


def test_a_syntax_error_without_a_valid_file_is_described():
    assert described(SyntaxError("alone")) == "SyntaxError: alone"
    error = SyntaxError("odd")
    error.filename, error.lineno = object(), 3
    assert described(error) == "SyntaxError: odd"


def test_an_unprintable_class_name_is_escaped():
    assert described(type("A\nB", (Exception,), {})("x")) == r"A\nB: x"


@pytest.mark.parametrize(
    ("kind", "name", "hint"),
    [
        ("method", "KODEX", "did you mean 'kodex'?"),
        ("method", "ndq", "did you mean 'ndp'?"),
        ("method", "lonely", "known while its package is installed: pip install -e FOLDER"),
        ("size", "lonely", "choose from kodex, ndp"),
    ],
)
def test_an_unknown_name_gets_the_nearest_one_or_says_how_it_becomes_known(kind, name, hint):
    assert str(unknown_name(kind, name, ["kodex", "ndp"])).endswith(hint)
