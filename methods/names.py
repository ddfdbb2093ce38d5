"""Checks the names of sizes and variants, which become parts of names of result folders."""

import re

from tasks.names import LONGEST, refusal

_LABEL = re.compile(rf"[A-Za-z0-9][A-Za-z0-9_.+]{{0,{LONGEST - 1}}}")


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
        raise refusal(f"a {kind}", name, allowed)
    if name == "smallest":
        raise refusal(f"a {kind}", name, "`--sizes smallest` names the first size of each method")
