"""The paper's numbers, from its appendix."""

from pathlib import Path

import pandas as pd

FOLDER = Path(__file__).with_name("published")


def published(name: str) -> pd.DataFrame:
    """Returns the numbers of a table: columns row, column, value, spread, note."""
    return pd.read_csv(FOLDER / f"{name}.csv")


def with_published(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """Returns an exhibit's table beside the paper's table of that name, see `with_numbers`."""
    return with_numbers(table, published(name))


def with_numbers(table: pd.DataFrame, paper: pd.DataFrame) -> pd.DataFrame:
    """Returns a table with the paper's numbers in added columns.

    Args:
        table: of an exhibit.
        paper: as `published` returns it. Rows that the table lacks are dropped.
    """
    paper = paper.rename(columns={"value": "published", "spread": "published spread"})
    added = paper[["row", "column", "published", "published spread", "note"]]
    return table.merge(added, on=["row", "column"], how="left")
