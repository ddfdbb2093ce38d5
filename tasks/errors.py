"""The error for bad input, and descriptions of other errors in one line."""

import difflib
import importlib
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import PurePath
from types import FrameType

LONGEST = 500
"""Largest number of characters in a described error."""
_LONGEST_PLACE = 200
_IMPORTLIB = ("<frozen importlib", os.path.join(os.path.dirname(importlib.__file__), ""))
"""Prefixes of the file names of importlib."""
_SUITE = ("bench", "methods", "reports", "tasks")
_LIBRARIES = {"numpy", "scipy", "torch", *sys.stdlib_module_names}
"""Packages whose errors are usually caused by their caller."""
_BACKPORT = os.path.join("", "importlib_metadata", "")
"""Part of the file names of the backport of importlib's entry points, where it is installed."""


BROUGHT = ("method", "task")
"""Kinds of things that packages bring."""


class InputError(ValueError):
    """The caller gave a value that is not allowed; the message says what is."""


def unknown_name(kind: str, name: object, allowed: Iterable[str]) -> InputError:
    """Returns the error for a name that is not among the allowed ones.

    It names the nearest one. If none is alike, it says how names of packages become known.

    Args:
        kind: the kind of thing that is named, such as ``"task"``.
        name: the unknown name.
        allowed: the names that exist.
    """
    known = list(allowed)
    found = nearest_name(name, known)
    hint = f"; did you mean {found!r}?" if found else ""
    if not found and kind in BROUGHT:
        hint = ". One of your own is known while its package is installed: pip install -e FOLDER"
    return InputError(f"unknown {kind} {name!r}: choose from {', '.join(known)}{hint}")


def nearest_name(name: object, known: Iterable[str]) -> str:
    """Returns the known name most like a name, in upper or lower case; empty if none is alike."""
    by_lower = {one.lower(): one for one in known}
    nearest = difflib.get_close_matches(str(name).lower(), by_lower, n=1)
    return by_lower[nearest[0]] if nearest else ""


def described(error: BaseException) -> str:
    """Returns an error in one line: type, message and place.

    For example ``KeyError: 'x' (mine.py:53 in fit)``. The place is the innermost frame of the
    package that the suite called, even if the error was raised in a library below it. It is never
    in importlib. For a SyntaxError, it is the line that cannot be parsed. Unprintable characters
    are escaped. The line has at most `LONGEST` characters. Never raises, even if the error's own
    methods do.
    """
    kind = printable(lambda: type(error).__name__, "error", 100)
    place = printable(lambda: _place(error), "", _LONGEST_PLACE)
    place = f" ({place})" if place else ""
    left = LONGEST - len(kind) - len(place) - 2
    message = printable(lambda: _message(error), "its message cannot be shown", left)
    return f"{kind}: {message}{place}" if message else f"{kind}{place}"


def reason_of(error: BaseException) -> str:
    """Returns the message of an InputError, and any other error as `described` returns it."""
    if isinstance(error, InputError):
        return printable(lambda: str(error), "its message cannot be shown", 4 * LONGEST)
    return described(error)


def printable(text: Callable[[], str], otherwise: str, longest: int) -> str:
    """Returns the text of an untrusted function in one printable line.

    Args:
        text: returns the text; it may raise anything.
        otherwise: returned if ``text`` raises.
        longest: largest number of characters; a longer text is cut and ends in ``...``.
    """
    try:
        start = str.__getitem__(text(), slice(0, longest + 1))
        escaped = "".join(
            c if c.isprintable() else c.encode("unicode_escape").decode() for c in start
        )
    except BaseException:
        return otherwise
    return escaped if len(escaped) <= longest else f"{escaped[: longest - 3]}..."


def _message(error: BaseException) -> str:
    if isinstance(error, SyntaxError) and error.filename and error.msg:
        return str(error.msg)
    return str(error)


def _place(error: BaseException) -> str:
    if isinstance(error, SyntaxError) and error.filename and error.lineno:
        return f"{_file(error.filename)}:{error.lineno}"
    frames: list[tuple[str, str]] = []
    first = trace = error.__traceback__
    while first and trace:
        code = trace.tb_frame.f_code
        of_importlib = code.co_filename.startswith(_IMPORTLIB) or _BACKPORT in code.co_filename
        if not of_importlib:
            function = "" if code.co_name == "<module>" else f" in {code.co_name}"
            place = f"{_file(code.co_filename)}:{trace.tb_lineno}{function}"
            frames.append((_package(trace.tb_frame), place))
        elif trace is first.tb_next:
            frames.clear()
        trace = trace.tb_next
    return _culprit(frames)


def _culprit(frames: list[tuple[str, str]]) -> str:
    """The place of the innermost frame of the package that the suite called last.

    Frames are pairs of package and place, the outermost first.
    """
    own = [i for i, (package, _) in enumerate(frames) if package in _SUITE]
    inner = frames[own[-1] + 1 if own else 0 :]
    callers = [package for package, _ in inner if package not in _LIBRARIES]
    if not callers:
        return frames[own[-1]][1] if own else frames[-1][1] if frames else ""
    return [place for package, place in inner if package == callers[0]][-1]


def _package(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", "")).partition(".")[0]


def _file(path: str) -> str:
    """The name of a file, with its folder for an ``__init__.py``."""
    parts = PurePath(path).parts
    return "/".join(parts[-2:] if parts[-1] == "__init__.py" else parts[-1:])
