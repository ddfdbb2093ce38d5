"""The rank of the lifted states, and the gap in their singular values behind it."""

import pandas as pd

from reports.diagnostics import gap
from reports.exhibit import Exhibit
from reports.results import Results
from reports.tables import table_of

ROWS = ("observables", "rank", "last that counts", "next")


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each of `ROWS` and a column for each task, the narrowest gap over seeds."""
    found = results.rows.main(method="kodex").drop_duplicates("folder")
    rows = []
    for task, mine in found.groupby("task", sort=False):
        observables, rank, last, following = zip(
            *(gap(results, fit) for fit in mine.folder), strict=True
        )
        values = (max(observables), min(rank), min(last), max(following))
        rows += [
            {"row": row, "column": task, "value": float(value), "seeds": len(mine)}
            for row, value in zip(ROWS, values, strict=True)
        ]
    return table_of(rows)


EXHIBIT = Exhibit(
    name="rank",
    title="Directions that the demonstrations excite",
    about="Rank of the lifted states of the demonstrations, at most the number of observables with"
    " the constant; and the two singular values between which the cut-off falls, relative to the"
    " largest. The further apart they are, the less K depends on rounding. Least over seeds; of the"
    " last value, the greatest.",
    table=table,
    part="KODex inside",
    unit="",
    digits=None,
    axis="",
    subjects=("kodex",),
)
