"""Audit of appendix I: success in changed physics, in other readings of the masses it names."""

import pandas as pd

from reports.exhibit import Exhibit, success_table
from reports.results import Results
from reports.style import METHODS, TASKS, ordered
from tasks.physics import CHANGES, READINGS


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each task and variation in each reading, and a column for each method."""
    parts = [
        results.main(task=task, split="test", physics=physics)
        for task in TASKS
        for physics in (*CHANGES[task], *READINGS[task])
    ]
    found = pd.concat(parts)
    found = found[found.controller != "tuned"]
    if not any(found.physics.isin(READINGS[task]).any() for task in TASKS):
        return pd.DataFrame(columns=["row", "column", "value"])
    found = found.assign(label=found.task + " " + found.physics)
    success = success_table(found, "label", "method")
    places = {
        "row": {name: place for place, name in enumerate(sorted(set(success.row), key=_order))},
        "column": {name: place for place, name in enumerate(ordered(success.column, METHODS))},
    }
    return success.sort_values(
        ["row", "column"], key=lambda names: names.map(places[str(names.name)])
    )


def _order(row: str) -> tuple[int, int]:
    """By task, and each variation followed by its other readings."""
    task, physics = row.split(" ")
    names = [name for c in CHANGES[task] for name in (c, c.replace("hand", "palm"), f"{c}_inertia")]
    return TASKS.index(task), names.index(physics)


EXHIBIT = Exhibit(
    name="audit_masses",
    title="Audit of masses: other readings of appendix I",
    about=(
        "Success [%] on unseen starts with the original controller, in changed physics as this"
        " suite reads appendix I, with the body named palm in place of the forearm (palm), and"
        " with inertia grown with the mass (inertia)."
    ),
    table=table,
    axis="",
)
