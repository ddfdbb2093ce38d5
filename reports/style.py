"""The look of all figures: a colour and a hatch for each method, legible in greyscale."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import seaborn as sns

from bench.labels import SEPARATOR
from methods.registry import SUITE

NAMES = {
    "expert": "Expert",
    "kodex": "KODex",
    "nn": "NN",
    "lstm": "LSTM",
    "ndp": "NDP",
    "ngf": "NGF",
    "nearest": "Nearest",
    "regression": "Regression",
    "bc": "BC",
    "chunk": "Chunk",
    "flow": "Flow",
    "tool": "Tool",
    "door": "Door",
    "relocation": "Relocation",
    "reorientation": "Reorientation",
    "ood": "out of distribution",
}
"""Names as readers see them."""
METHODS = ("expert", *SUITE)
INK = "#222222"
"""Colour of text, axes, intervals and the paper's values."""
MARKS = ("", "///", "...", "\\\\\\", "xx", "--", "++")
DASHES: tuple[Any, ...] = (
    (0, (1, 1)),
    "-",
    (0, (5, 1.5)),
    (0, (6, 1.5, 1, 1.5)),
    (0, (2.5, 1)),
    (0, (6, 1, 1, 1, 1, 1)),
    (0, (1, 2.5)),
    (0, (9, 2)),
)
MARKERS = "*o^sDvPX<>h"
_COLOURS = (
    "#4c4c4c",
    *sns.color_palette("colorblind", 5).as_hex(),
    *("#8a6d00", "#6a4ca5", "#e63946", "#7cb518", "#5c4742"),
)
"""Colours of the methods."""
_OTHERS = ("#7f4f24", "#56b4e9", "#949494", "#9b2226", "#4f7942")
"""Colours of other rows: sizes, tasks, the user's methods."""
ON_DARK = {
    "#4c4c4c": "#b9b9b9",
    "#0173b2": "#3f9fe0",
    "#7f4f24": "#c08a5a",
    "#9b2226": "#e0656a",
    "#8a6d00": "#c9a227",
    "#6a4ca5": "#a18be0",
    "#5c4742": "#b09a94",
}
"""Replacements on a dark page, for colours that are too dark there."""


def display(name: str, suffixes: Mapping[str, str] | None = None) -> str:
    """Returns a name as readers see it.

    Args:
        name: words, such as the names of a method and a controller.
        suffixes: text after a word, by word.
    """
    suffixes = suffixes or {}
    words = (_word(word) + suffixes.get(word, "") for word in str(name).split(" "))
    return " ".join(words)


def _word(name: str) -> str:
    label = re.sub(rf"{SEPARATOR}(?=\w)", "_", name, count=1)
    return " ".join(NAMES.get(part, part) for part in label.split("_"))


def colour(row: str, rows: Sequence[str]) -> str:
    """Returns the colour of a row: a method's own, or that of its place among the other rows.

    Args:
        row: name of a method, size or task.
        rows: all names in the figure.
    """
    return (*_COLOURS, *_OTHERS)[_index(row, rows)]


def hatch(row: str, rows: Sequence[str]) -> str:
    """Returns the hatch of a row's bars, chosen as its `colour` is."""
    return MARKS[_index(row, rows) % len(MARKS)]


def dashes(row: str, rows: Sequence[str]) -> Any:
    """Returns the dashes of a row's lines, chosen as its `colour` is."""
    return DASHES[_index(row, rows) % len(DASHES)]


def marker(row: str, rows: Sequence[str]) -> str:
    """Returns the marker of a row's points, chosen as its `colour` is."""
    return MARKERS[_index(row, rows) % len(MARKERS)]


def _index(row: str, rows: Sequence[str]) -> int:
    if row in METHODS:
        return METHODS.index(row)
    others = [one for one in rows if one not in METHODS]
    return len(METHODS) + others.index(row) % len(_OTHERS)


def ordered(names: Any, order: Sequence[str]) -> list[str]:
    """Returns distinct names in the given order. Other names come last, sorted."""
    found = list(dict.fromkeys(names))
    return [name for name in order if name in found] + sorted(set(found) - set(order))


@contextmanager
def style() -> Iterator[None]:
    """Sets fonts, grid and file settings. The same figure gives the same bytes."""
    settings: dict[Any, Any] = {
        **sns.axes_style("whitegrid"),
        "font.size": 10,
        "figure.dpi": 150,
        "figure.constrained_layout.use": True,
        "svg.hashsalt": "kodex-bench",
        "axes.spines.top": False,
        "axes.spines.right": False,
    }
    with mpl.rc_context(settings):
        yield
