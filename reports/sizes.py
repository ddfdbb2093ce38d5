"""What Tables 1 to 5 share: success by size of model from the validation starts."""

import pandas as pd

from bench.labels import plain
from reports.exhibit import Exhibit, in_order, success_table, with_published
from reports.results import SIZES, Results
from reports.style import display


def size_exhibit(number: int, method: str) -> Exhibit:
    """Returns the exhibit of one method's sizes."""
    name = f"table_{number}"

    def table(results: Results) -> pd.DataFrame:
        found = results.select(split="validation")
        found = found[found.method.map(plain) == method]
        found = found[found.demos == found.groupby("task").demos.transform("max")]
        own = found.method == method
        found = found.assign(label=found["size"].where(own, found.method + " " + found["size"]))
        return with_published(in_order(success_table(results, found, "label", "task"), SIZES), name)

    return Exhibit(
        name=name,
        title=f"Table {number}: success of {display(method)} by size of model",
        about=f"Success [%] of {display(method)} from the starts of the validation demonstrations.",
        table=table,
        of=(method,),
    )
