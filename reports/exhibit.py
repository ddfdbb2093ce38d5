"""An exhibit: a table of values by row and column, its figure and its caption."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bench.power import in_points
from reports.charts import bars
from reports.remarks import Remark
from reports.results import Results
from reports.seed_statistics import ALIKE, ONE_SEED, OVER_SEEDS
from reports.style import display

MARK = "†"
"""Follows the interval of a single seed."""
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
        sentences = [self.about, *self.footnotes(table)]
        if "diverged" in table and table.diverged.sum():
            sentences.append(f"{int(table.diverged.sum())} diverged episodes count as failures.")
        if "published" in table and table.published.notna().any():
            diamonds = "Diamonds, and numbers in parentheses, are the paper's."
            sentences.append(diamonds if self.axis else "Numbers in parentheses are the paper's.")
            if "published spread" in table and table["published spread"].notna().any():
                sentences.append(POPULATION)
        names = [*self.subjects, *(table[["row", "column"]].stack() if self.remarks else ())]
        shown = {word for name in names for word in str(name).split(" ")}
        sentences += [remark.text for remark in self.remarks if remark.concerns(shown)]
        return " ".join(sentences)

    def footnotes(self, table: pd.DataFrame) -> list[str]:
        """Returns what a reader must know of seeds, intervals and letters."""
        notes = [_about_seeds(table)] if "seeds" in table and table.seeds.notna().any() else []
        lettered = "letters" in table and table.letters.any()
        if "basis" in table:
            about = _BASES | {ONE_SEED: footnote_on_single_fits("letters" if lettered else "")}
            notes += [note for basis, note in about.items() if (table.basis == basis).any()]
        if not lettered:
            return notes
        known = "detectable" in table
        return [*notes, LETTERS, *([self._smallest_shown(table)] if known else [])]

    def _smallest_shown(self, table: pd.DataFrame) -> str:
        """Says what differences the seeds could have shown, by column."""
        known = table.dropna(subset="detectable").drop_duplicates("column")
        if known.empty:
            return (
                "What difference could have been missed is unknown: these seeds do not show how"
                " they vary."
            )
        points = [
            f"{self.display(row.column)} {in_points(row.detectable)}" for row in known.itertuples()
        ]
        return (
            "True differences below these are missed in a fifth of studies or more, of two methods"
            f" that vary as these do, without correction [points]: {', '.join(points)}."
        )

    def summarised(self, table: pd.DataFrame) -> pd.DataFrame:
        """Returns the rows that people read."""
        return self.summary(table) if self.summary else table

    def wide(self, table: pd.DataFrame) -> pd.DataFrame:
        """Returns the table as readers see it: one line for each row, one text for each cell."""
        table = self.summarised(table)
        texts = table.assign(text=[self.text(row) for row in table.to_dict("records")])
        order = {name: texts[name].drop_duplicates().tolist() for name in ("row", "column")}
        wide = texts.pivot(index="row", columns="column", values="text")
        wide = wide.reindex(index=order["row"], columns=order["column"]).fillna("-")
        wide.index = pd.Index([self.display(name) for name in wide.index], name="")
        wide.columns = pd.Index([self.display(name) for name in wide.columns])
        return wide.reset_index()

    def text(self, row: dict[str, Any]) -> str:
        """Returns a row of the table as the text of a cell."""

        def number(value: float) -> str:
            return f"{value:g}" if self.digits is None else f"{value:.{self.digits}f}"

        text = number(row["value"]) if np.isfinite(row["value"]) else "-"
        if np.isfinite(row.get("spread", np.nan)):
            text += f" ± {number(row['spread'])}"
        if np.isfinite(row.get("low", np.nan)):
            mark = MARK if row.get("basis") == ONE_SEED else ""
            text += f" [{number(row['low'])}, {number(row['high'])}]{mark}"
        if letters := row.get("letters"):
            text += f" {letters}"
        if np.isfinite(row.get("published", np.nan)):
            spread = row.get("published spread", np.nan)
            more = f" ± {number(spread)}" if np.isfinite(spread) else ""
            text += f" ({number(row['published'])}{more})"
        return text


def footnote_on_single_fits(other: str = "") -> str:
    """Returns the footnote of marked intervals, and of something other that speaks of one seed."""
    interval = "the 95% interval (Wilson's)"
    what = f"{interval} and the {other} speak" if other else f"{interval} speaks"
    return f"{MARK} One seed: {what} of {ONE_SEED}; dotted where drawn."


def _about_seeds(table: pd.DataFrame) -> str:
    """Says how many seeds and starts the values are of."""
    seeds = span(table.seeds.dropna())
    if "n" not in table or table.n.isna().all():
        return f"Seeds: {seeds}."
    starts = span(table.n.dropna())
    if seeds == "1":
        return f"1 seed with {starts} start{'s' if starts != '1' else ''}."
    return f"{seeds} seeds, each with {starts} starts of its own."


POPULATION = (
    "The paper's ± is that of a population of five seeds, as Table 2 shows; that of a sample, as"
    " ours is, would be 12% larger."
)
LETTERS = (
    "Methods of a column that share a letter cannot be told apart: p is above 0.05 after Holm's"
    " correction for all its pairs of methods."
)
_BASES = {
    OVER_SEEDS: "Brackets: 95% intervals over seeds (Student's t), and so over demonstrations,"
    " controllers, random numbers and starts, but not over experts.",
    ALIKE: "Where all episodes of all seeds end alike, Wilson's interval of all episodes.",
}
"""What intervals speak of, by basis."""


def span(values: pd.Series) -> str:
    """Returns the least and the greatest of whole numbers as text, or one if all are equal."""
    low, high = int(values.min()), int(values.max())
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"
