"""An exhibit: a table of values by row and column, its figure and its caption."""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from reports.paper import published
from reports.remarks import Remark
from reports.results import Results
from reports.style import INK, TASKS, colour, display, hatch, marker, ordered
from tasks.data import FloatArray

COVERAGE = {2: "51 to 96", 3: "70 to 97", 4: "78 to 98", 5: "81 to 98"}
"""By number of seeds, how often the bootstrap's interval holds the mean: simulated, with a standard
deviation of 4 to 16 points between seeds, 200 or 1,000 starts that are as hard for all seeds or for
each in its own way, 500 studies of each kind."""
PAPER = "paper"
UNCOVERED = "They do not cover what another controller would change."
FROM_PAPER = ["published", "published spread", "note"]
Part = Literal["success", "robustness", "data and time", "KODex inside", "audit"]
PARTS: tuple[Part, ...] = get_args(Part)
"""The headings of the page, in its order."""


@dataclass(frozen=True)
class Exhibit:
    """One table or figure of the appendix, or of this suite."""

    name: str
    title: str
    about: str
    """What the values are, for the caption."""
    table: Callable[[Results], pd.DataFrame]
    """Returns rows of ``row``, ``column``, ``value`` and what else is known of each value."""
    part: Part = "success"
    """The heading that it stands under."""
    unit: str = "%"
    digits: int | None = 1
    """Behind the point; none for as many as it takes."""
    axis: str = "success [%]"
    figure: Callable[[pd.DataFrame, "Exhibit"], Figure] | None = None
    """Draws the table; bars by column and row unless told."""
    of: tuple[str, ...] = ()
    """The task or the method that all of it is about, where the table does not name it."""
    remarks: tuple[Remark, ...] = ()
    """Of the results that it is made from, see `with_remarks`."""
    summary: Callable[[pd.DataFrame], pd.DataFrame] | None = None
    """Returns what people read of a table that is too long for them, as such a table."""
    suffixes: Mapping[str, str] = field(default_factory=dict)
    """By name of a method, what follows it."""
    own: frozenset[str] = frozenset()
    """Methods that are not the suite's: tables and legends highlight them."""

    def with_remarks(self, results: Results) -> "Exhibit":
        """Returns the exhibit with what its captions and names say of the results."""
        remarks = tuple(results.remarks)
        return replace(self, remarks=remarks, suffixes=results.suffixes, own=results.own)

    def display(self, name: str) -> str:
        """Returns how a name is written for people."""
        return display(name, self.suffixes)

    def is_own(self, name: str) -> bool:
        """Whether a row or a column is about a method that is not the suite's."""
        return not self.own.isdisjoint(str(name).split(" "))

    def draw(self, table: pd.DataFrame) -> Figure:
        """Returns the figure of a table."""
        return (self.figure or bars)(table, self)

    def caption(self, table: pd.DataFrame) -> str:
        """Returns what a reader must know of the values."""
        said = [self.about]
        if "n" in table and table.n.notna().any():
            said.append(f"n = {span(table.n)} episodes of each fit.")
        if "seeds" in table and table.seeds.notna().any():
            said.append(f"Seeds: {span(table.seeds)}.")
            if "low" in table:
                said.append(_intervals(int(table.seeds.max())))
        if "diverged" in table and table.diverged.sum():
            said.append(f"{int(table.diverged.sum())} diverged episodes count as failures.")
        if "published" in table and table.published.notna().any():
            said.append("Diamonds, and numbers in parentheses, are the paper's.")
        names = [*self.of, *(table[["row", "column"]].stack() if self.remarks else ())]
        shown = {word for name in names for word in str(name).split(" ")}
        said += [remark.text for remark in self.remarks if remark.concerns(shown)]
        return " ".join(said)

    def summarised(self, table: pd.DataFrame) -> pd.DataFrame:
        """Returns the rows that people read, where the figure draws more than they can."""
        return self.summary(table) if self.summary else table

    def wide(self, table: pd.DataFrame) -> pd.DataFrame:
        """Returns the table for people: one line a row, one text a cell."""
        table = self.summarised(table)
        texts = table.assign(text=[self._text(row) for row in table.to_dict("records")])
        order = {name: texts[name].drop_duplicates().tolist() for name in ("row", "column")}
        wide = texts.pivot(index="row", columns="column", values="text")
        wide = wide.reindex(index=order["row"], columns=order["column"]).fillna("-")
        wide.index = pd.Index([self.display(name) for name in wide.index], name="")
        wide.columns = pd.Index([self.display(name) for name in wide.columns])
        return wide.reset_index()

    def _text(self, row: dict[str, float]) -> str:
        def number(value: float) -> str:
            return f"{value:g}" if self.digits is None else f"{value:.{self.digits}f}"

        text = number(row["value"]) if np.isfinite(row["value"]) else "-"
        if np.isfinite(row.get("spread", np.nan)):
            text += f" ± {number(row['spread'])}"
        if np.isfinite(row.get("low", np.nan)):
            text += f" [{number(row['low'])}, {number(row['high'])}]"
        if np.isfinite(row.get("published", np.nan)):
            spread = row.get("published spread", np.nan)
            more = f" ± {number(spread)}" if np.isfinite(spread) else ""
            text += f" ({number(row['published'])}{more})"
        return text


def success_table(
    results: Results, evaluations: pd.DataFrame, row: str, column: str
) -> pd.DataFrame:
    """Returns success [%] by two columns of the evaluations, which become row and column."""
    found = results.rates(evaluations, [row, column])
    return found.rename(columns={row: "row", column: "column"})


def in_order(
    table: pd.DataFrame, rows: Sequence[str], columns: Sequence[str] = TASKS
) -> pd.DataFrame:
    """Returns the table with rows and columns in the given order, others after them."""
    places = {
        "row": {name: place for place, name in enumerate(ordered(table.row, rows))},
        "column": {name: place for place, name in enumerate(ordered(table.column, columns))},
    }
    return table.sort_values(
        ["row", "column"], key=lambda names: names.map(places[str(names.name)])
    )


def with_published(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """Returns the table with an exhibit's published values beside it, see `beside`."""
    return beside(table, published(name))


def beside(table: pd.DataFrame, paper: pd.DataFrame) -> pd.DataFrame:
    """Returns the table with the paper's values beside it; rows of the paper alone are left out."""
    paper = paper.rename(columns={"value": "published", "spread": "published spread"})
    return table.merge(paper[["row", "column", *FROM_PAPER]], on=["row", "column"], how="left")


def bars(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns bars with intervals, grouped by column, one colour a row, the paper's as diamonds."""
    return _grouped(table, exhibit, _add_bars)


def dots(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns dots as `bars` does, on an axis that fits the values and need not begin at zero."""
    return _grouped(table, exhibit, _add_dots)


def log_dots(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns dots on a logarithmic axis."""
    drawing = dots(table, exhibit)
    logarithmic(drawing.axes[0])
    return drawing


def logarithmic(axes: Axes) -> None:
    """Makes the y-axis logarithmic, its ticks plain numbers."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()


def panels(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns bars as `bars` does, a panel for each kind of row "method kind".

    A row without a kind, as the expert's, stands in each, beside what that kind has. Where no row
    has a kind, there is one panel.
    """
    names = table.row.str.split(" ", n=1, expand=True).reindex(columns=[0, 1])
    kinds = names[1].dropna().unique()
    if not len(kinds):
        return bars(table, exhibit)
    rows, columns = names[0].nunique(), table.column.nunique()
    drawing = Figure(figsize=(_width(rows, columns), 0.4 + 1.9 * len(kinds)))
    every = drawing.subplots(len(kinds), squeeze=False, sharex=True, sharey=True)[:, 0]
    for axes, kind in zip(every, kinds, strict=True):
        own = names[1] == kind
        here = own | (names[1].isna() & table.column.isin(table.column[own]))
        part = table[here].assign(row=names[0][here])
        _add_bars(axes, part, exhibit, table.column.drop_duplicates().tolist())
        axes.set_title(exhibit.display(kind), fontsize=10, loc="left")
    add_legend(drawing, exhibit)
    return drawing


def add_legend(drawing: Figure, exhibit: Exhibit) -> None:
    """Adds one legend above all axes: methods of one's own bold, the paper's last."""
    found = {
        label: handle
        for axes in drawing.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    found = dict(sorted(found.items(), key=lambda one: one[0] == PAPER))
    in_a_row = min(len(found), max(2, int(drawing.get_figwidth() / 0.85)))
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


def _grouped(
    table: pd.DataFrame, exhibit: Exhibit, add: Callable[[Axes, pd.DataFrame, Exhibit], None]
) -> Figure:
    rows, columns = (table[name].nunique() for name in ("row", "column"))
    drawing = Figure(figsize=(_width(rows, columns), 3.2))
    add(drawing.subplots(), table, exhibit)
    add_legend(drawing, exhibit)
    return drawing


def _width(rows: int, columns: int) -> float:
    """Inches, as few as let a phone show the figure whole and legible."""
    return max(0.9 + 0.22 * rows * columns, 1.1 * columns + 0.9, 3.5)


def _add_bars(
    axes: Axes, table: pd.DataFrame, exhibit: Exhibit, columns: Sequence[str] | None = None
) -> None:
    rows = table.row.drop_duplicates().tolist()
    columns = table.column.drop_duplicates().tolist() if columns is None else columns
    width = min(0.8 / len(rows), 0.3)
    for i, row in enumerate(rows):
        part = table[table.row == row].set_index("column").reindex(columns)
        x = np.arange(len(columns)) + (i - (len(rows) - 1) / 2) * width
        axes.bar(
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
        _add_published(axes, x, part)
    _name_columns(axes, columns, exhibit)
    if exhibit.unit == "%":
        axes.set_ylim(0, 105)


def _add_dots(axes: Axes, table: pd.DataFrame, exhibit: Exhibit) -> None:
    rows, columns = (table[name].drop_duplicates().tolist() for name in ("row", "column"))
    for i, row in enumerate(rows):
        part = table[table.row == row].set_index("column").reindex(columns)
        x = np.arange(len(columns)) + (i - (len(rows) - 1) / 2) * min(0.6 / len(rows), 0.2)
        shade = colour(row, rows)
        axes.plot(x, part.value, marker(row, rows), ms=7, color=shade, label=exhibit.display(row))
        _add_published(axes, x, part)
    _name_columns(axes, columns, exhibit)
    axes.set_xlim(-0.6, len(columns) - 0.4)
    axes.margins(y=0.15)


def _add_published(axes: Axes, x: ArrayLike, part: pd.DataFrame) -> None:
    if "published" in part and part.published.notna().any():
        axes.plot(x, part.published, "D", ms=4, color=INK, mec="white", label=PAPER, clip_on=False)


def _name_columns(axes: Axes, columns: Sequence[str], exhibit: Exhibit) -> None:
    axes.set_xticks(range(len(columns)), [_narrow(exhibit.display(name)) for name in columns])
    axes.set(ylabel=exhibit.axis)
    axes.grid(axis="x", visible=False)


def errors_of(table: pd.DataFrame) -> FloatArray | None:
    """Returns how far the intervals (2, rows) reach below and above the values, if there are any.

    At 0 and 100% rounding may put an end past the value.
    """
    if "low" not in table or table.low.isna().all():
        return None
    return np.maximum([table.value - table.low, table.high - table.value], 0)


def _narrow(text: str) -> str:
    return textwrap.fill(text, 11, break_long_words=False)


def _intervals(seeds: int) -> str:
    """What the intervals are, where there are at most so many seeds."""
    if seeds == 1:
        return f"Intervals are 95%, Wilson's. {UNCOVERED}"
    known = min(COVERAGE, key=lambda count: abs(count - seeds))
    return (
        "Intervals are 95%: Wilson's for a single fit, else the percentile bootstrap over seeds and"
        f" starts, which at {known} seeds covers the truth in {COVERAGE[known]} of 100 simulated"
        f" studies. {UNCOVERED}"
    )


def span(values: pd.Series) -> str:
    """Returns the lowest and the highest of whole numbers as text, or the one there is."""
    low, high = int(values.min()), int(values.max())
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"
