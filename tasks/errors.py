"""The one error for bad input: it names the value, what is allowed, and the nearest name."""

import difflib
from collections.abc import Iterable


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
