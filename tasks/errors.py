"""The one error for bad input, and any error in one line."""

import difflib
import importlib
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import PurePath
from types import FrameType

LONGEST = 500
"""Characters of a described error, at most."""
_LONGEST_PLACE = 200
_IMPORTLIB = ("<frozen importlib", os.path.join(os.path.dirname(importlib.__file__), ""))
"""How the names of importlib's own files begin."""
_SUITE = ("bench", "methods", "reports", "tasks")
_LIBRARIES = {"numpy", "scipy", "torch", *sys.stdlib_module_names}
"""What may raise for the sake of whoever has called it, by package."""
_BACKPORT = os.path.join("", "importlib_metadata", "")
"""Part of the names of files that, where they are installed, load entry points in its place."""


class InputError(ValueError):
    """A value that the caller gave cannot be used; the message says what can."""


def unknown_name(kind: str, name: object, allowed: Iterable[str]) -> InputError:
    """Returns the error for a name that is not among the allowed ones.

    Args:
        kind: what is named, for the message: ``"task"``, ``"split"``.
        name: the name that was given.
        allowed: the names that exist.
    """
    known = list(allowed)
    nearest = difflib.get_close_matches(str(name), known, n=1)
    hint = f"; did you mean {nearest[0]!r}?" if nearest else ""
    return InputError(f"unknown {kind} {name!r}: choose from {', '.join(known)}{hint}")


def described(error: BaseException) -> str:
    """Returns an error in one line: type, message and place.

    For example ``KeyError: 'x' (mine.py:53 in fit)``. The place is the innermost frame of the
    package that the suite has called, whatever library that has called in turn. It is never in
    importlib, and of a SyntaxError it is the line that cannot be parsed. Characters that cannot be
    printed are escaped. The line has at most `LONGEST` characters. Never raises, whatever the
    error's own methods do.
    """
    kind = printable(lambda: type(error).__name__, "error", 100)
    place = printable(lambda: _place(error), "", _LONGEST_PLACE)
    place = f" ({place})" if place else ""
    left = LONGEST - len(kind) - len(place) - 2
    message = printable(lambda: _message(error), "its message cannot be shown", left)
    return f"{kind}: {message}{place}" if message else f"{kind}{place}"


def reason_of(error: BaseException) -> str:
    """Returns the message of an InputError, which says it all, and any other error `described`."""
    if isinstance(error, InputError):
        return printable(lambda: str(error), "its message cannot be shown", 4 * LONGEST)
    return described(error)


def printable(text: Callable[[], str], otherwise: str, longest: int) -> str:
    """Returns what a function of somebody else's says, in one line that can be printed.

    Args:
        text: returns it, or raises whatever it likes.
        otherwise: what is returned if it raises.
        longest: characters of what is returned, at most; what is cut ends in ``...``.
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
    """The place of the last frame of what the suite called last; frames are packages and places."""
    own = [i for i, (package, _) in enumerate(frames) if package in _SUITE]
    inner = frames[own[-1] + 1 if own else 0 :]
    callers = [package for package, _ in inner if package not in _LIBRARIES]
    if not callers:
        return frames[own[-1]][1] if own else frames[-1][1] if frames else ""
    return [place for package, place in inner if package == callers[0]][-1]


def _package(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", "")).partition(".")[0]


def _file(path: str) -> str:
    """The name of a file; of a package's ``__init__.py`` with its folder."""
    parts = PurePath(path).parts
    return "/".join(parts[-2:] if parts[-1] == "__init__.py" else parts[-1:])
