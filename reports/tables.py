"""Tables of exhibits: one line for each value, in columns row, column, value and more."""

from collections.abc import Mapping, Sequence

import pandas as pd

from reports.results import Results
from reports.style import ordered
from tasks.registry import TASKS


def table_of(rows: Sequence[Mapping[str, object]] = ()) -> pd.DataFrame:
    """Returns a table of values, each with its row and column. By default the table is empty."""
    return pd.DataFrame(rows, columns=["row", "column", "value"])


def success_table(
    results: Results, evaluations: pd.DataFrame, row: str, column: str
) -> pd.DataFrame:
    """Returns success [%], grouped by two columns of the evaluations.

    See `reports.episodes.Episodes.rates`.
    """
    found = results.episodes.rates(evaluations, [row, column])
    return found.rename(columns={row: "row", column: "column"})


def difference_table(pairs: Sequence[pd.DataFrame], rows: Sequence[str]) -> pd.DataFrame:
    """Returns the differences of pairs [points], in order; only those of two or more seeds.

    Args:
        pairs: as `reports.pairs.pairs_of` returns them, with columns ``row`` and ``column``.
        rows: see `in_order`.
    """
    several = [one[one.seeds > 1] for one in pairs if (one.seeds > 1).any()]
    if not several:
        return table_of()
    shown = pd.concat(several).rename(columns={"difference": "value"})
    return in_order(shown[["row", "column", "value", "low", "high", "seeds", "n"]], rows)


def in_order(
    table: pd.DataFrame, rows: Sequence[str], columns: Sequence[str] = TASKS
) -> pd.DataFrame:
    """Returns a table with its rows and columns in the given order; other names come last."""
    places = {
        "row": {name: place for place, name in enumerate(ordered(table.row, rows))},
        "column": {name: place for place, name in enumerate(ordered(table.column, columns))},
    }
    return table.sort_values(
        ["row", "column"], key=lambda names: names.map(places[str(names.name)])
    )
