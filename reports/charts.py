"""Figures of tables: bars and dots by row and column, and the panels and legends of any figure."""

import math
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from reports.seed_statistics import ONE_SEED
from reports.style import INK, colour, dashes, display, hatch, marker
from tasks.data import FloatArray

if TYPE_CHECKING:
    from reports.exhibit import Exhibit

SMALL = (1.65, 1.6)
"""Width and height of a panel of `panel_grid` [inches]."""
HANDLE, LETTER = 0.5, 0.085
"""Width of an entry of a legend without its label, and of a letter, at most [inches]."""
PAPER = "paper"
"""The paper's values, in legends."""


def bars(table: pd.DataFrame, exhibit: "Exhibit") -> Figure:
    """Returns bars with intervals: a group for each column, a colour for each row.

    Diamonds are the paper's values.
    """
    return _grouped(table, exhibit, _add_bars)


def dots(table: pd.DataFrame, exhibit: "Exhibit") -> Figure:
    """Returns dots, grouped as in `bars`, on an axis that fits the values and may omit zero."""
    return _grouped(table, exhibit, _add_dots)


def log_dots(table: pd.DataFrame, exhibit: "Exhibit") -> Figure:
    """Returns dots on a logarithmic axis."""
    drawing = dots(table, exhibit)
    set_logarithmic(drawing.axes[0])
    return drawing


def set_logarithmic(axes: Axes) -> None:
    """Makes the y-axis logarithmic, with plain numbers as labels."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()


def panels(table: pd.DataFrame, exhibit: "Exhibit") -> Figure:
    """Returns bars in panels, one for each kind of row. A row is "method kind", or "method".

    A row without a kind, such as the expert's, is repeated in each panel, in the columns that the
    panel has. There is one panel if no row has a kind.
    """
    names = table.row.str.split(" ", n=1, expand=True).reindex(columns=[0, 1])
    kinds = names[1].dropna().unique()
    if not len(kinds):
        return bars(table, exhibit)
    rows, columns = names[0].nunique(), table.column.nunique()
    drawing = Figure(figsize=(_width(rows, columns), 0.4 + 1.9 * len(kinds)))
    every = drawing.subplots(len(kinds), squeeze=False, sharex=True, sharey=True)[:, 0]
    for axes, kind in zip(every, kinds, strict=True):
        of_kind = names[1] == kind
        here = of_kind | (names[1].isna() & table.column.isin(table.column[of_kind]))
        part = table[here].assign(row=names[0][here])
        _add_bars(axes, part, exhibit, table.column.drop_duplicates().tolist())
        axes.set_title(exhibit.display(kind), fontsize=10, loc="left")
    add_legend(drawing, exhibit)
    return drawing


def task_panels(
    tasks: Sequence[str],
    panel: tuple[float, float],
    margin: tuple[float, float],
    sharex: bool = False,
) -> tuple[Figure, dict[str, Axes]]:
    """Returns a figure and its panels, titled with their tasks, two in a row.

    Args:
        tasks: names.
        panel: width and height of a panel [inches].
        margin: width and height to add to those of all panels [inches].
        sharex: whether panels share the x-axis. They share the y-axis.
    """
    rows, columns = -(-len(tasks) // 2), min(len(tasks), 2)
    drawing = Figure(figsize=(panel[0] * columns + margin[0], panel[1] * rows + margin[1]))
    every = drawing.subplots(rows, columns, sharex=sharex, sharey=True, squeeze=False).ravel()
    for empty in every[len(tasks) :]:
        empty.remove()
    found = dict(zip(tasks, every, strict=False))
    for task, axes in found.items():
        axes.set_title(display(task), fontsize=10, loc="left")
    return drawing, found


def panel_grid(
    rows: int, columns: int, margin: tuple[float, float], sharex: bool | Literal["col"] = True
) -> tuple[Figure, Any]:
    """Returns a figure of success [%] and its small panels (rows, columns).

    Args:
        rows: number of panels below each other.
        columns: number of panels beside each other.
        margin: width and height to add to those of all panels [inches].
        sharex: whether all panels, or those of a column, share the x-axis. All share the y-axis.
    """
    size = (SMALL[0] * columns + margin[0], SMALL[1] * rows + margin[1])
    drawing = Figure(figsize=size)
    panels = drawing.subplots(rows, columns, sharex=sharex, sharey=True, squeeze=False)
    panels[0, 0].set_ylim(-3, 103)
    return drawing, panels


def add_line(
    axes: Axes,
    x: ArrayLike,
    part: pd.DataFrame,
    row: str,
    rows: Sequence[str],
    exhibit: "Exhibit",
) -> None:
    """Adds the line of a row, with its intervals if there are any.

    Args:
        axes: the panel.
        x: places of the values on the x-axis.
        part: the values, lines of a table.
        row: name of the row.
        rows: all names in the figure.
        exhibit: whose names readers see.
    """
    drawn = axes.errorbar(
        x,
        part.value,
        errors_of(part),
        marker=marker(row, rows),
        ls=dashes(row, rows),
        ms=3.5,
        lw=1.2,
        elinewidth=0.7,
        color=colour(row, rows),
        label=exhibit.display(row),
    )
    dot_single_fits(drawn, part)


def add_legend(drawing: Figure, exhibit: "Exhibit") -> None:
    """Adds one legend above all panels, the user's methods in bold and the paper's values last."""
    found = {
        label: handle
        for axes in drawing.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    found = dict(sorted(found.items(), key=lambda one: one[0] == PAPER))
    in_a_row = _in_a_row(list(found), drawing.get_figwidth())
    legend = drawing.legend(
        found.values(),
        found.keys(),
        frameon=False,
        loc="outside upper left",
        ncols=in_a_row,
        columnspacing=1.2,
        handlelength=1.6,
    )
    own = {exhibit.display(name) for name in exhibit.own}
    for text in legend.get_texts():
        if text.get_text() in own:
            text.set_fontweight("bold")


def _in_a_row(labels: Sequence[str], width: float) -> int:
    """Returns how many columns a legend of a width [inches] has, at least 2 if there are 2.

    It has as few rows as fit, all of them as long as each other if possible.
    """
    for columns in range(len(labels), 2, -1):
        longest = [max(map(len, part)) for part in np.array_split(labels, columns)]
        if sum(HANDLE + LETTER * letters for letters in longest) <= width:
            rows = math.ceil(len(labels) / columns)
            return math.ceil(len(labels) / rows)
    return min(len(labels), 2)


def add_marker_legend(drawing: Figure, looks: Mapping[str, Mapping[str, Any]]) -> None:
    """Adds a legend of markers below all panels. Looks are arguments of `Axes.scatter` by label."""
    handles = [drawing.axes[0].scatter([], [], label=name, **look) for name, look in looks.items()]
    drawing.legend(
        handles=handles, frameon=False, loc="outside lower center", ncols=min(len(handles), 3)
    )


def by_row(
    table: pd.DataFrame, rows: Sequence[str], columns: Sequence[str], width: float
) -> Iterator[tuple[str, ArrayLike, pd.DataFrame]]:
    """Yields each row with the places of its values on the x-axis, and its values by column.

    Args:
        table: with the columns ``row`` and ``column``, one value for each pair of names.
        rows: names; the values of a column stand beside each other in this order.
        columns: names, at 0, 1, 2 and so on. A row that lacks one has NaN there.
        width: distance of two rows.
    """
    for i, row in enumerate(rows):
        x = np.arange(len(columns)) + (i - (len(rows) - 1) / 2) * width
        yield row, x, table[table.row == row].set_index("column").reindex(columns)


def errors_of(table: pd.DataFrame) -> FloatArray | None:
    """Returns how far intervals reach below and above the values (2, rows). None without intervals.

    At 0 and 100% rounding may put an end past the value.
    """
    if "low" not in table or table.low.isna().all():
        return None
    return np.maximum([table.value - table.low, table.high - table.value], 0)


def dot_single_fits(drawn: ErrorbarContainer | None, table: pd.DataFrame) -> None:
    """Dots the intervals that speak of a single fit, unlike those over seeds.

    Args:
        drawn: the intervals, one for each row of the table. None without intervals.
        table: whose column ``basis`` says what they speak of.
    """
    if drawn is not None and "basis" in table:
        for lines in drawn.lines[2]:
            lines.set_linestyle([":" if basis == ONE_SEED else "-" for basis in table.basis])


def _grouped(
    table: pd.DataFrame, exhibit: "Exhibit", add: Callable[[Axes, pd.DataFrame, "Exhibit"], None]
) -> Figure:
    rows, columns = (table[name].nunique() for name in ("row", "column"))
    drawing = Figure(figsize=(_width(rows, columns), 3.2))
    add(drawing.subplots(), table, exhibit)
    add_legend(drawing, exhibit)
    return drawing


def _width(rows: int, columns: int) -> float:
    """Returns inches: narrow enough that a phone shows the whole figure legibly."""
    return max(0.9 + 0.22 * rows * columns, 1.1 * columns + 0.9, 3.5)


def _add_bars(
    axes: Axes, table: pd.DataFrame, exhibit: "Exhibit", columns: Sequence[str] | None = None
) -> None:
    rows = table.row.drop_duplicates().tolist()
    columns = table.column.drop_duplicates().tolist() if columns is None else columns
    width = min(0.8 / len(rows), 0.3)
    for row, x, part in by_row(table, rows, columns, width):
        drawn = axes.bar(
            x,
            part.value,
            0.92 * width,
            yerr=errors_of(part),
            capsize=2,
            label=exhibit.display(row),
            color=colour(row, rows),
            hatch=hatch(row, rows),
            edgecolor="white",
            error_kw={"lw": 0.9, "ecolor": INK},
        )
        dot_single_fits(drawn.errorbar, part)
        _add_published(axes, x, part)
    _name_columns(axes, columns, exhibit)
    if exhibit.unit == "%":
        axes.set_ylim(0, 105)


def _add_dots(axes: Axes, table: pd.DataFrame, exhibit: "Exhibit") -> None:
    rows, columns = (table[name].drop_duplicates().tolist() for name in ("row", "column"))
    for row, x, part in by_row(table, rows, columns, min(0.6 / len(rows), 0.2)):
        shade = colour(row, rows)
        axes.plot(x, part.value, marker(row, rows), ms=7, color=shade, label=exhibit.display(row))
        _add_published(axes, x, part)
    _name_columns(axes, columns, exhibit)
    axes.set_xlim(-0.6, len(columns) - 0.4)
    axes.margins(y=0.15)


def _add_published(axes: Axes, x: ArrayLike, part: pd.DataFrame) -> None:
    if "published" in part and part.published.notna().any():
        axes.plot(x, part.published, "D", ms=4, color=INK, mec="white", label=PAPER, clip_on=False)


def _name_columns(axes: Axes, columns: Sequence[str], exhibit: "Exhibit") -> None:
    names = [textwrap.fill(exhibit.display(name), 11, break_long_words=False) for name in columns]
    axes.set_xticks(range(len(columns)), names)
    axes.set(ylabel=exhibit.axis)
    axes.grid(axis="x", visible=False)
