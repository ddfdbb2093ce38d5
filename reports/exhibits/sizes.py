"""Tables 1 to 5: success of each method by size of model, from the validation starts."""

import pandas as pd

from bench.labels import plain
from bench.selection import SIZES
from reports.exhibit import Exhibit
from reports.paper import with_published
from reports.results import Results
from reports.style import display
from reports.tables import in_order, success_table


def _exhibit(name: str, method: str, title: str) -> Exhibit:
    def table(results: Results) -> pd.DataFrame:
        """Returns a row for each size and a column for each task."""
        found = results.rows.select(split="validation")
        found = found[found.method.map(plain) == method]
        found = found[found.demos == found.groupby("task").demos.transform("max")]
        size = found["size"].where(found.method == method, found.method + " " + found["size"])
        rates = success_table(results, found.assign(label=size), "label", "task")
        rates = in_order(rates, SIZES).replace({"row": {"single": method}})
        return with_published(rates, name)

    about = f"Success [%] of {display(method)} from the starts of the validation demonstrations."
    return Exhibit(name, title, about, table, subjects=(method,))


EXHIBITS = (
    _exhibit("table_1", "kodex", "Table 1: success of KODex on the validation starts"),
    _exhibit("table_2", "nn", "Table 2: success of NN by size of model"),
    _exhibit("table_3", "lstm", "Table 3: success of LSTM by size of model"),
    _exhibit("table_4", "ndp", "Table 4: success of NDP by size of model"),
    _exhibit("table_5", "ngf", "Table 5: success of NGF by size of model"),
)
