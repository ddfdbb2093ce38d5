"""Checks the names of methods and tasks.

They become names of result folders, words on command lines and Python modules.
"""

import keyword
import re
import sys
from collections.abc import Iterable
from importlib.util import find_spec

from tasks.errors import InputError, printable

LONGEST = 40
RESERVED = ("expert", "none", "validation", "bench", "methods", "reports", "tasks")
"""Names that the suite uses itself, for rows of tables, splits, controllers and packages."""
_NAME = re.compile(rf"[a-z][a-z0-9_]{{0,{LONGEST - 1}}}")


def check_name(kind: str, name: object, taken: Iterable[str] = ()) -> None:
    """Checks the name of a method or task.

    Args:
        kind: ``"method"`` or ``"task"``.
        name: a word of a-z, 0-9 and _ that begins with a letter. It must not be a keyword of
            Python, a module of its standard library or one of `RESERVED`.
        taken: names that are in use.

    Raises:
        InputError: the name is not allowed.
    """
    what = f"a {kind}"
    if fault := word_fault(name):
        raise refusal(what, name, fault)
    assert isinstance(name, str)
    if keyword.iskeyword(name):
        raise refusal(what, name, "it is a keyword of Python")
    if name in sys.stdlib_module_names:
        raise refusal(what, name, "it is a module of Python's standard library")
    if name in RESERVED:
        raise refusal(what, name, "the suite itself uses the name")
    if name in taken:
        raise refusal(what, name, "there is a method, task or preset of that name already")


def word_fault(name: object) -> str:
    """Returns why something is not a word that can name files and options, or an empty text."""
    if isinstance(name, str) and _NAME.fullmatch(name):
        return ""
    return f"use 1 to {LONGEST} of a-z, 0-9 and _, a letter first"


def check_new_name(kind: str, name: str, taken: Iterable[str]) -> None:
    """Checks the name of a method or task whose module will be written, see `check_name`.

    Raises:
        InputError: the name is not allowed, or a module of that name is installed.
    """
    check_name(kind, name, taken)
    try:
        module = find_spec(name)
        importable = module is not None and module.origin is not None  # a folder has no origin
    except ValueError:  # an imported module without a __spec__
        importable = True
    if importable:
        raise refusal(f"a {kind}", name, "a module of that name is installed")


def refusal(what: str, name: object, reason: str) -> InputError:
    """Returns the error that something, such as ``a method``, cannot have a name."""
    shown = printable(lambda: repr(name), f"a {type(name).__name__}", 2 * LONGEST)
    return InputError(f"{what} cannot be called {shown}: {reason}")
