"""Checks the names of methods, sizes and variants.

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
_METHOD = re.compile(rf"[a-z][a-z0-9_]{{0,{LONGEST - 1}}}")
_LABEL = re.compile(rf"[A-Za-z0-9][A-Za-z0-9_.+]{{0,{LONGEST - 1}}}")


def check_method_name(name: object, taken: Iterable[str] = ()) -> None:
    """Checks the name of a method.

    Args:
        name: a word of a-z, 0-9 and _ that begins with a letter. It must not be a keyword of
            Python, a module of its standard library or one of `RESERVED`.
        taken: names that are in use.

    Raises:
        InputError: the name is not allowed.
    """
    if not (isinstance(name, str) and _METHOD.fullmatch(name)):
        raise _refusal("a method", name, f"use 1 to {LONGEST} of a-z, 0-9 and _, a letter first")
    if keyword.iskeyword(name):
        raise _refusal("a method", name, "it is a keyword of Python")
    if name in sys.stdlib_module_names:
        raise _refusal("a method", name, "it is a module of Python's standard library")
    if name in RESERVED:
        raise _refusal("a method", name, "the suite itself uses the name")
    if name in taken:
        raise _refusal("a method", name, "there is a method, task or preset of that name already")


def check_new_name(name: str, taken: Iterable[str]) -> None:
    """Checks the name of a method whose module will be written, see `check_method_name`.

    Raises:
        InputError: the name is not allowed, or a module of that name is installed.
    """
    check_method_name(name, taken)
    try:
        module = find_spec(name)
        importable = module is not None and module.origin is not None  # a folder has no origin
    except ValueError:  # an imported module without a __spec__
        importable = True
    if importable:
        raise _refusal("a method", name, "a module of that name is installed")


def check_label(kind: str, name: object) -> None:
    """Checks the name of a size or a variant.

    Args:
        kind: ``"size"`` or ``"variant"``.
        name: a word of ASCII letters, digits, _, . and + that begins with a letter or a digit.

    Raises:
        InputError: the name is not allowed.
    """
    if not (isinstance(name, str) and _LABEL.fullmatch(name)):
        allowed = f"use 1 to {LONGEST} ASCII letters, digits, _, . and +, a letter or digit first"
        raise _refusal(f"a {kind}", name, allowed)
    if name == "smallest":
        raise _refusal(f"a {kind}", name, "`--sizes smallest` names the first size of each method")


def _refusal(what: str, name: object, reason: str) -> InputError:
    shown = printable(lambda: repr(name), f"a {type(name).__name__}", 2 * LONGEST)
    return InputError(f"{what} cannot be called {shown}: {reason}")
