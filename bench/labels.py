"""What rows are called whose method was fitted in several ways.

A method that a study has fitted with several values of ``--set``, or on several sets of
demonstrations, has several rows: ``mine``, ``mine:hidden=64``, ``mine:demos=3f2a91c0``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from tasks.data import key
from tasks.errors import unknown_name

if TYPE_CHECKING:
    import pandas as pd

EXPERT = "expert"
"""Stands for a method in tables; nothing is fitted for it."""
VALIDATION = "validation"
"""The split whose starts are those of the validation demonstrations."""
SEPARATOR = ":"
LONGEST = 80
DEMOS_DIGITS = 8


def as_text(settings: Mapping[str, Any]) -> str:
    """Returns the fields of a config and their values as a part of a label: ``hidden=64x32``."""
    text = "+".join(f"{name}={_value(settings[name])}" for name in sorted(settings))
    if len(text) <= LONGEST:
        return text
    return f"{text[: LONGEST - 10]}~{key('settings', text)[:8]}"  # a name of a folder


def _value(value: object) -> str:
    if isinstance(value, list | tuple):
        return "x".join(map(_value, value))
    return re.sub(r"[^\w.+-]", "_", str(value))


def labelled(frame: pd.DataFrame) -> pd.DataFrame:
    """Returns rows of `bench.source.Source.frame` with labels of their own for a method's fits.

    A method's name is followed by what `--set` has changed where its rows differ in that, and by
    the key of its demonstrations where those of a task differ in that and are not the expert's.
    """
    learnt = frame[frame.method != EXPERT]
    if learnt.empty:
        return frame
    own = frame[frame.method == EXPERT].drop_duplicates("task").set_index("task").demos_key
    several = learnt.groupby("method").settings.transform("nunique") > 1
    others = learnt.groupby(["task", "method"]).demos_key.transform("nunique") > 1
    others &= learnt.demos_key != learnt.task.map(own)
    changed = learnt.settings.where(several, "")
    demos = ("demos=" + learnt.demos_key.str[:DEMOS_DIGITS]).where(others, "")
    suffix = changed.where((changed == "") | (demos == ""), changed + "+") + demos
    label = learnt.method.where(suffix == "", learnt.method + SEPARATOR + suffix)
    return frame.assign(method=label.reindex(frame.index).fillna(frame.method))


def plain(label: str) -> str:
    """Returns the name of a label's method."""
    return label.partition(SEPARATOR)[0]


def labels_of(name: str, known: list[str]) -> list[str]:
    """Returns the labels that a name stands for: itself, or all of the method of that name.

    Raises:
        InputError: it is neither.
    """
    found = [name] if name in known else [label for label in known if plain(label) == name]
    if not found:
        raise unknown_name("method with results", name, known)
    return found
