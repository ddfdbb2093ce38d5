"""What Tables 7 to 10 share: success of one task in changed physics."""

import pandas as pd

from reports.exhibit import Exhibit, in_order, panels, success_table, with_published
from reports.results import Results
from reports.style import METHODS, display
from tasks.masses import PHYSICS, VARIATIONS


def robustness_exhibit(number: int, task: str) -> Exhibit:
    """Returns the exhibit of one task."""
    name = f"table_{number}"

    def table(results: Results) -> pd.DataFrame:
        varied = [results.main(task=task, split="test", physics=v) for v in VARIATIONS]
        found = pd.concat(varied)
        if found.empty:
            return found.assign(row=[], column=[], value=[])
        same = results.main(task=task, split="test")
        found = pd.concat([same, found])
        label = found.method.where(
            found.controller == "none", found.method + " " + found.controller
        )
        success = success_table(results, found.assign(label=label), "label", "physics")
        rows = [f"{m} {c}" for c in ("original", "tuned") for m in METHODS[1:]]
        success = in_order(success, ("expert", *rows), PHYSICS)
        return with_published(success, name)

    return Exhibit(
        name=name,
        title=f"Table {number}: robustness to changed physics, {display(task)}",
        about=(
            f"Success [%] on {display(task)} in changed physics, with the original controller and"
            " with one tuned on the expert's rollouts there."
        ),
        table=table,
        part="robustness",
        figure=panels,
        of=(task,),
    )
