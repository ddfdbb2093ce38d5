"""What learning from the second expert of a task changes, against the first."""

from functools import partial

import pandas as pd

from reports.exhibit import Exhibit
from reports.exhibits.two_experts import PLACES, of_both
from reports.pairs import pairs_of
from reports.results import Results
from reports.style import METHODS
from reports.tables import difference_table, table_of
from tasks.registry import EXPERTS


def table(results: Results, split: str) -> pd.DataFrame:
    """Returns success under the second expert minus under the first, by method and task [points].

    See `reports.exhibits.two_experts.of_both` for which methods and tasks. Only values of two or
    more seeds are shown.
    """
    rows = of_both(results, split)
    if rows.empty:
        return table_of()
    latest_first = rows.sort_values("expert", key=lambda names: -names.map(EXPERTS.index))
    changes = [
        pairs_of(results, both.assign(method=both.expert)).assign(row=method, column=task)
        for (method, task), both in latest_first.groupby(["method", "task"])
    ]
    return difference_table(changes, METHODS)


EXHIBITS = tuple(
    Exhibit(
        name=f"expert_change_{split}",
        title=f"What the second expert changes: {place}",
        about=f"Success {starts} under the second expert minus that under the first [points],"
        " from the same starts of the same seeds, each method in one size under both. Brackets: 95%"
        " intervals of the change over seeds (Student's t), not corrected for the number of"
        " methods and tasks.",
        table=partial(table, split=split),
        part="robustness",
        unit="points",
        axis="",
    )
    for split, place, starts in PLACES
)
