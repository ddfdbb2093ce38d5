"""Table 1: success of KODex from the starts of the validation demonstrations."""

from dataclasses import replace

import pandas as pd

from reports.exhibit import with_published
from reports.results import Results
from reports.sizes import size_exhibit

_SIZES = size_exhibit(1, "kodex")


def table(results: Results) -> pd.DataFrame:
    """Returns one row, KODex, and a column for each task."""
    found = _SIZES.table(results).drop(columns=["published", "published spread", "note"])
    return with_published(found.assign(row=found.row.replace("single", "kodex")), "table_1")


EXHIBIT = replace(_SIZES, title="Table 1: success of KODex on the validation starts", table=table)
