"""An exhibit: a table of values by row and column, its figure and its caption."""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reports.paper import published
from reports.remarks import Remark
from reports.results import Results
from reports.style import PUBLISHED, TASKS, colour, display, hatch, ordered
from tasks.data import FloatArray

COVERAGE = {2: "51 to 96", 3: "70 to 97", 4: "78 to 98", 5: "81 to 98"}
"""By number of seeds, how often the bootstrap's interval holds the mean: simulated, with a standard
deviation of 4 to 16 points between seeds, 200 or 1,000 starts that are as hard for all seeds or for
each in its own way, 500 studies of each kind."""
UNCOVERED = "They do not cover what another controller would change."
FROM_PAPER = ["published", "published spread", "note"]


@dataclass(frozen=True)
class Exhibit:
    """One table or figure of the appendix, or of this suite."""

    name: str
    title: str
    about: str
    """What the values are, for the caption."""
    table: Callable[[Results], pd.DataFrame]
    """Returns rows of ``row``, ``column``, ``value`` and what else is known of each value."""
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

    def with_remarks(self, results: Results) -> "Exhibit":
        """Returns the exhibit with what its captions and names say of the results."""
        return replace(self, remarks=tuple(results.remarks), suffixes=results.suffixes)

    def display(self, name: str) -> str:
        """Returns how a name is written for people."""
        return display(name, self.suffixes)

    def draw(self, table: pd.DataFrame) -> Figure:
        """Returns the figure of a table."""
        return (self.figure or bars)(table, self)

    def caption(self, table: pd.DataFrame) -> str:
        """Returns what a reader must know of the values."""
        said = [self.about]
        if "n" in table and table.n.notna().any():
            said.append(f"n = {_range(table.n)} episodes of each fit.")
        if "seeds" in table and table.seeds.notna().any():
            said.append(f"Seeds: {_range(table.seeds)}.")
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

    def wide(self, table: pd.DataFrame) -> pd.DataFrame:
        """Returns the table for people: one line a row, one text a cell."""
        table = self.summary(table) if self.summary else table
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
    rows, columns = (table[name].nunique() for name in ("row", "column"))
    drawing = Figure(figsize=(max(0.9 + 0.28 * rows * columns, 1.4 * columns, 3), 3.2))
    axes = drawing.subplots()
    _add_bars(axes, table, exhibit)
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1.02))
    return drawing


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
    drawing = Figure(
        figsize=(max(0.9 + 0.22 * rows * columns, 6), 2.2 * len(kinds)), layout="constrained"
    )
    every = drawing.subplots(len(kinds), squeeze=False, sharex=True, sharey=True)[:, 0]
    for axes, kind in zip(every, kinds, strict=True):
        own = names[1] == kind
        here = own | (names[1].isna() & table.column.isin(table.column[own]))
        part = table[here].assign(row=names[0][here])
        _add_bars(axes, part, exhibit, table.column.drop_duplicates().tolist())
        axes.set_title(exhibit.display(kind), fontsize=10, loc="left")
    every[0].legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1.02))
    return drawing


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
            error_kw={"lw": 0.9},
        )
        if "published" in part and part.published.notna().any():
            label = "paper" if i == len(rows) - 1 else None
            axes.plot(x, part.published, "D", ms=4, color=PUBLISHED, mec="white", label=label)
    axes.set_xticks(range(len(columns)), [_narrow(exhibit.display(name)) for name in columns])
    axes.set(ylabel=exhibit.axis)
    if exhibit.unit == "%":
        axes.set_ylim(0, 105)
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


def _range(values: pd.Series) -> str:
    low, high = int(values.min()), int(values.max())
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"
