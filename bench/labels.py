"""Labels of methods that were fitted in several ways.

If results hold fits of a method with several values of ``--set``, or on several sets of
demonstrations, each has a label of its own: ``mine``, ``mine:hidden=64``, ``mine:demos=3f2a91c0``.
A method that was not trained always says so: ``mine:weights_from_file``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import reduce
from typing import TYPE_CHECKING, Any

from tasks.data import key
from tasks.errors import unknown_name
from tasks.registry import SECOND

if TYPE_CHECKING:
    import pandas as pd

EXPERT = "expert"
"""Name of the expert in tables, beside methods. Nothing is fitted for it."""
VALIDATION = "validation"
"""Name of the split with the starts of the validation demonstrations."""
SEPARATOR = ":"
FROM_FILE = "weights_from_file"
"""Part of the label of a method that was not trained."""
OF_SECOND = "second_expert"
"""Part of the label of a method that the second expert taught, beside those that the first did."""
LONGEST = 80
DIGITS = 8
"""Digits of a key or digest in a label."""


def as_text(settings: Mapping[str, Any]) -> str:
    """Returns fields of a config and their values as part of a label, such as ``hidden=64x32``."""
    text = "+".join(f"{name}={_value(settings[name])}" for name in sorted(settings))
    if len(text) <= LONGEST:
        return text
    return f"{text[: LONGEST - 10]}~{key('settings', text)[:8]}"  # part of a folder name


def _value(value: object) -> str:
    if isinstance(value, list | tuple):
        return "x".join(map(_value, value))
    return re.sub(r"[^\w.+-]", "_", str(value))


def labelled(frame: pd.DataFrame) -> pd.DataFrame:
    """Returns the rows of `bench.source.Source.frame` with labels in place of method names.

    The label adds the changes of `--set` if the rows of a method differ in them. It adds the key of
    the demonstrations if the rows of a method on a task differ in it and they are not the expert's.
    If both experts are among the rows, what the second did or taught is labelled by its name.
    It adds `FROM_FILE` to methods with given weights, with digits if several are given on a task.
    """
    if frame.expert.nunique() > 1:
        import pandas as pd

        told = [labelled(part).method for _, part in frame.groupby("expert")]
        method = reduce(pd.Series.combine_first, told)
        suffix = method.str.contains(SEPARATOR).map({True: "+", False: SEPARATOR}) + OF_SECOND
        return frame.assign(method=method.where(frame.expert != SECOND, method + suffix))
    learnt = frame[frame.method != EXPERT]
    if learnt.empty:
        return frame
    own = frame[frame.method == EXPERT].drop_duplicates("task").set_index("task").demos_key
    several = learnt.groupby("method").settings.transform("nunique") > 1
    others = learnt.groupby(["task", "method"]).demos_key.transform("nunique") > 1
    others &= learnt.demos_key != learnt.task.map(own)
    changed = learnt.settings.where(several, "")
    demos = ("demos=" + learnt.demos_key.str[:DIGITS]).where(others, "")
    given = learnt.weights.where(learnt.weights != "")
    many = given.groupby([learnt.task, learnt.method]).transform("nunique") > 1
    digits = ("=" + learnt.weights.str[:DIGITS]).where(many, "")
    weights = (FROM_FILE + digits).where(given.notna(), "")
    suffixes = [
        "+".join(filter(None, parts)) for parts in zip(changed, weights, demos, strict=True)
    ]
    label = learnt.method.where(
        [not suffix for suffix in suffixes], learnt.method + SEPARATOR + suffixes
    )
    return frame.assign(method=label.reindex(frame.index).fillna(frame.method))


def plain(label: str) -> str:
    """Returns the name of the method in a label."""
    return label.partition(SEPARATOR)[0]


def labels_of(name: str, known: list[str]) -> list[str]:
    """Returns the labels that a name selects: the label itself, or all labels of that method.

    Raises:
        InputError: it is neither.
    """
    found = [name] if name in known else [label for label in known if plain(label) == name]
    if not found:
        raise unknown_name("method with results", name, known)
    return found
