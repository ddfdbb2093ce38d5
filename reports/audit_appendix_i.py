"""Audit of appendix I: success in changed physics, in other readings of what it says."""

import pandas as pd

from bench.controller_kinds import ON_SUCCESSES, TUNED
from reports.exhibit import Exhibit, in_order, success_table
from reports.results import Results
from reports.style import METHODS, TASKS
from tasks.masses import CHANGES, READINGS


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each task and variation in each reading, and a column for each method."""
    parts = [
        results.main(task=task, split="test", physics=physics)
        for task in TASKS
        for physics in (*CHANGES[task], *READINGS[task])
    ]
    parts += [
        results.main(task=task, split="test", physics=physics, controller=ON_SUCCESSES)
        for task in TASKS
        for physics in CHANGES[task]
    ]
    found = pd.concat(parts)
    if not any(found.physics.isin(READINGS[task]).any() for task in TASKS):
        return pd.DataFrame(columns=["row", "column", "value"])
    label = found.task + " " + found.physics
    tuned = found.controller.isin([TUNED, ON_SUCCESSES])
    found = found.assign(label=label.where(~tuned, label + " " + found.controller))
    success = success_table(results, found, "label", "method")
    return in_order(success, sorted(set(success.row), key=_order), METHODS)


def _order(row: str) -> tuple[int, int]:
    """By task, and each variation followed by its other readings."""
    task, reading = row.split(" ", 1)
    names = [
        name
        for c in CHANGES[task]
        for name in (
            c,
            c.replace("hand", "palm"),
            f"{c}_inertia",
            f"{c} {TUNED}",
            f"{c} {ON_SUCCESSES}",
        )
    ]
    return TASKS.index(task), names.index(reading)


EXHIBIT = Exhibit(
    name="audit_appendix_i",
    title="Audit of appendix I: other readings of it",
    about=(
        "Success [%] on unseen starts in changed physics as this suite reads appendix I, with the"
        " body named palm in place of the forearm (palm), and with inertia grown with the mass"
        " (inertia); with the original controller, with the tuned one, and with one tuned on the"
        " expert's successes alone."
    ),
    table=table,
    part="audit",
    axis="",
)
