"""The paper's own numbers, from its appendix."""

from pathlib import Path

import pandas as pd

FOLDER = Path(__file__).with_name("published")


def published(name: str) -> pd.DataFrame:
    """Returns an exhibit's numbers: columns table, row, column, value, spread, n."""
    return pd.read_csv(FOLDER / f"{name}.csv")
