"""Tables 7 to 10: success on each task in changed physics."""

from functools import partial

import pandas as pd

from bench.controller_kinds import NO_CONTROLLER, ORIGINAL, TUNED
from reports.charts import panels
from reports.exhibit import Exhibit
from reports.paper import with_published
from reports.results import Results
from reports.style import METHODS, display
from reports.tables import in_order, success_table, table_of
from tasks.masses import PHYSICS, VARIATIONS

TABLES = {
    "tool": "table_7",
    "door": "table_8",
    "relocation": "table_9",
    "reorientation": "table_10",
}
"""The table of each task."""
CONTROLLERS = (ORIGINAL, TUNED)


def _exhibit(task: str, title: str) -> Exhibit:
    def table(results: Results) -> pd.DataFrame:
        """Returns a row for each method and controller, and a column for each physics."""
        of_task = partial(results.rows.select, task=task, split="test")
        if all(of_task(physics=v).empty for v in VARIATIONS):
            return table_of()
        tuned = [of_task(physics=v, controller=TUNED) for v in VARIATIONS]
        found = pd.concat(
            results.rows.at_one_size([*(of_task(physics=v) for v in PHYSICS), *tuned])
        )
        uncontrolled = found.controller == NO_CONTROLLER
        label = found.method.where(uncontrolled, found.method + " " + found.controller)
        rates = success_table(results, found.assign(label=label), "label", "physics")
        rows = ["expert", *(f"{method} {c}" for c in CONTROLLERS for method in METHODS[1:])]
        return with_published(in_order(rates, rows, PHYSICS), TABLES[task])

    about = (
        f"Success [%] on {display(task)} in changed physics, with the original controller and"
        " with one tuned on the expert's rollouts there."
    )
    return Exhibit(
        TABLES[task],
        title,
        about,
        table,
        part="robustness",
        figure=panels,
        subjects=(task,),
    )


EXHIBITS = (
    _exhibit("tool", "Table 7: robustness to changed physics, Tool"),
    _exhibit("door", "Table 8: robustness to changed physics, Door"),
    _exhibit("relocation", "Table 9: robustness to changed physics, Relocation"),
    _exhibit("reorientation", "Table 10: robustness to changed physics, Reorientation"),
)
