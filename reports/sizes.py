"""What Tables 1 to 5 share: success by size of model from the validation starts."""

import pandas as pd

from reports.exhibit import Exhibit, success_table, with_published
from reports.results import SIZES, Results
from reports.style import TASKS, display, ordered


def size_exhibit(number: int, method: str) -> Exhibit:
    """Returns the exhibit of one method's sizes."""
    name = f"table_{number}"

    def table(results: Results) -> pd.DataFrame:
        found = results.select(method=method, split="validation")
        found = found[found.demos == found.demos.max()]
        by_size = success_table(found, "size", "task")
        places = {size: place for place, size in enumerate(ordered(by_size.row, SIZES))}
        tasks = {task: place for place, task in enumerate(TASKS)}
        order = by_size.assign(a=by_size.row.map(places), b=by_size.column.map(tasks))
        return with_published(order.sort_values(["a", "b"]).drop(columns=["a", "b"]), name)

    return Exhibit(
        name=name,
        title=f"Table {number}: success of {display(method)} by size of model",
        about=f"Success [%] of {display(method)} from the starts of the validation demonstrations.",
        table=table,
    )
