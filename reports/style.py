"""How every figure looks: one colour and one mark per method, legible in greyscale."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import seaborn as sns

METHOD_NAMES = {
    "expert": "Expert",
    "kodex": "KODex",
    "nn": "NN",
    "lstm": "LSTM",
    "ndp": "NDP",
    "ngf": "NGF",
}
TASK_NAMES = {
    "tool": "Tool",
    "door": "Door",
    "relocation": "Relocation",
    "reorientation": "Reorientation",
}
PUBLISHED = "#555555"
_COLOURS = sns.color_palette("colorblind").as_hex()


def colour(method: str) -> str:
    """Returns the colour of a method, everywhere the same; others share the rest."""
    known = list(METHOD_NAMES)
    place = known.index(method) if method in known else len(known)
    return str(_COLOURS[place % len(_COLOURS)])


@contextmanager
def style() -> Iterator[None]:
    """Fonts, grid and file settings; the same figure gives the same bytes."""
    settings: dict[Any, Any] = {
        **sns.axes_style("whitegrid"),
        "font.size": 10,
        "axes.titlesize": 11,
        "figure.dpi": 150,
        "savefig.bbox": "tight",
        "svg.hashsalt": "kodex-bench",
        "svg.fonttype": "path",
        "axes.spines.top": False,
        "axes.spines.right": False,
    }
    with mpl.rc_context(settings):
        yield
