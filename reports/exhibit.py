"""An exhibit: a table of values by row and column, its figure and its caption."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from reports.charts import bars
from reports.remarks import Remark
from reports.results import Results
from reports.style import display

COVERAGE = {2: "51 to 96", 3: "70 to 97", 4: "78 to 98", 5: "81 to 98"}
"""How many of 100 bootstrap intervals hold the mean, by number of seeds. Simulated: 500 studies of
each kind, with a standard deviation of 4 to 16 points between seeds and 200 or 1,000 starts, whose
difficulty is shared by all seeds or differs between them."""
UNCOVERED = "They do not cover the variation between controllers."
Part = Literal["success", "robustness", "data and time", "KODex inside", "audit"]
PARTS: tuple[Part, ...] = get_args(Part)
"""The headings of the page, in its order."""


@dataclass(frozen=True)
class Exhibit:
    """A table or figure of the appendix, or of this suite."""

    name: str
    title: str
    about: str
    """What the values are, for the caption."""
    table: Callable[[Results], pd.DataFrame]
    """Returns columns ``row``, ``column``, ``value`` and what else is known of each value."""
    part: Part = "success"
    """Its heading on the page."""
    unit: str = "%"
    digits: int | None = 1
    """Decimals of a value. None: as many as the value needs."""
    axis: str = "success [%]"
    """Label of the figure's axis. Empty: no figure."""
    figure: Callable[[pd.DataFrame, "Exhibit"], Figure] = bars
    """Draws the table."""
    subjects: tuple[str, ...] = ()
    """The task or method of the whole exhibit, where the table does not name it."""
    remarks: tuple[Remark, ...] = ()
    """Sentences that the caption may need, see `with_remarks`."""
    summary: Callable[[pd.DataFrame], pd.DataFrame] | None = None
    """Shortens a table that is too long to read, to a table of the same form."""
    suffixes: Mapping[str, str] = field(default_factory=dict)
    """Text after the name of a method, by method."""
    own: frozenset[str] = frozenset()
    """The user's methods, which tables and legends highlight."""

    def with_remarks(self, results: Results) -> "Exhibit":
        """Returns the exhibit with the remarks, suffixes and own methods of the results."""
        remarks = tuple(results.remarks)
        return replace(self, remarks=remarks, suffixes=results.suffixes, own=results.own)

    def display(self, name: str) -> str:
        """Returns a name as readers see it."""
        return display(name, self.suffixes)

    def is_own(self, name: str) -> bool:
        """Returns whether a row or column is about a method of the user's."""
        return not self.own.isdisjoint(str(name).split(" "))

    def draw(self, table: pd.DataFrame) -> Figure:
        """Returns the figure of a table."""
        return self.figure(table, self)

    def caption(self, table: pd.DataFrame) -> str:
        """Returns what a reader must know of the values."""
        sentences = [self.about]
        if "n" in table and table.n.notna().any():
            sentences.append(f"n = {span(table.n)} episodes of each fit.")
        if "seeds" in table and table.seeds.notna().any():
            sentences.append(f"Seeds: {span(table.seeds)}.")
            if "low" in table:
                sentences.append(_about_intervals(int(table.seeds.max())))
        if "diverged" in table and table.diverged.sum():
            sentences.append(f"{int(table.diverged.sum())} diverged episodes count as failures.")
        if "published" in table and table.published.notna().any():
            sentences.append("Diamonds, and numbers in parentheses, are the paper's.")
        names = [*self.subjects, *(table[["row", "column"]].stack() if self.remarks else ())]
        shown = {word for name in names for word in str(name).split(" ")}
        sentences += [remark.text for remark in self.remarks if remark.concerns(shown)]
        return " ".join(sentences)

    def summarised(self, table: pd.DataFrame) -> pd.DataFrame:
        """Returns the rows that people read."""
        return self.summary(table) if self.summary else table

    def wide(self, table: pd.DataFrame) -> pd.DataFrame:
        """Returns the table as readers see it: one line for each row, one text for each cell."""
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


def _about_intervals(seeds: int) -> str:
    """Says what the intervals of at most so many seeds are."""
    if seeds == 1:
        return f"Intervals are 95%, Wilson's. {UNCOVERED}"
    known = min(COVERAGE, key=lambda count: abs(count - seeds))
    return (
        "Intervals are 95%: Wilson's for a single fit, else the percentile bootstrap over seeds and"
        f" starts, which at {known} seeds covers the truth in {COVERAGE[known]} of 100 simulated"
        f" studies. {UNCOVERED}"
    )


def span(values: pd.Series) -> str:
    """Returns the least and the greatest of whole numbers as text, or one if all are equal."""
    low, high = int(values.min()), int(values.max())
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"
