"""Success from test starts, the paper's main comparison."""

import pandas as pd

from reports.exhibit import Exhibit
from reports.pairing import keep_common
from reports.pairs import letters_of, pairs_of_table, smallest_shown
from reports.results import Results
from reports.style import METHODS
from reports.tables import in_order, success_table


def success_by_method(results: Results, split: str) -> pd.DataFrame:
    """Returns success [%] on a split, see `success_of`."""
    return success_of(results, results.rows.main(split=split))


def success_of(results: Results, evaluations: pd.DataFrame) -> pd.DataFrame:
    """Returns success [%]: a row for each method, a column for each task.

    Methods of a task that share one of the ``letters`` cannot be told apart. ``detectable``
    [points] is the smallest difference that the seeds could have shown, the same in all rows of a
    task. Where methods have different seeds, neither is known.
    """
    found = keep_common(evaluations)
    table = success_table(results, found, "method", "task")
    parts = [
        with_letters(part, pairs_of_table(results, found[found.task == task]))
        for task, part in table.groupby("column", sort=False)
    ]
    return in_order(pd.concat(parts) if parts else table, METHODS)


def with_letters(part: pd.DataFrame, pairs: pd.DataFrame) -> pd.DataFrame:
    """Returns a column of a table with what its pairs of methods tell, in two added columns.

    Args:
        part: rows of a table, one for each method.
        pairs: as `reports.pairs.pairs_of` returns them.
    """
    there = part[part.row.isin({*pairs.left, *pairs.right})]
    letters = letters_of(pairs, dict(zip(there.row, there.value, strict=True)))
    return part.assign(
        letters=[letters.get(method, "") for method in part.row], detectable=smallest_shown(pairs)
    )


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method and the expert, and a column for each task."""
    return success_by_method(results, "test")


EXHIBIT = Exhibit(
    name="success",
    title="Success on test starts",
    about="Success [%] from test starts, which are unseen and in distribution. The paper has a"
    " figure without numbers.",
    table=table,
)
