"""Audit of appendix I: success in changed physics, under other readings of the text."""

import numpy as np
import pandas as pd

from bench.controller_kinds import FINE_TUNED, ON_SUCCESSES, TUNED
from reports.exhibit import Exhibit
from reports.results import Results
from reports.style import METHODS
from reports.tables import in_order, success_table, table_of
from tasks.masses import CHANGES, READINGS
from tasks.registry import TASKS


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each task and reading of a variation, and a column for each method."""
    parts = [
        results.rows.select(task=task, split="test", physics=physics)
        for task in TASKS
        for physics in (*CHANGES[task], *READINGS[task])
    ]
    parts += [
        results.rows.select(task=task, split="test", physics=physics, controller=controller)
        for task in TASKS
        for physics in CHANGES[task]
        for controller in (TUNED, ON_SUCCESSES, FINE_TUNED)
    ]
    found = pd.concat(results.rows.at_one_size(parts))
    others = [found.physics.isin(READINGS[task]) & (found.task == task) for task in TASKS]
    read = found[np.logical_or.reduce(others)]
    if read.empty:
        return table_of()
    found = found[found.method.isin(read.method)]
    label = found.task + " " + found.physics
    tuned = found.controller.isin([TUNED, ON_SUCCESSES, FINE_TUNED])
    found = found.assign(label=label.where(~tuned, label + " " + found.controller))
    return in_order(success_table(results, found, "label", "method"), _rows(), METHODS)


def _rows() -> list[str]:
    """Returns all rows, by task, with each variation followed by its other readings."""
    return [
        f"{task} {reading}"
        for task in TASKS
        for change in CHANGES[task]
        for reading in (
            change,
            change.replace("hand", "palm"),
            f"{change}_inertia",
            f"{change} {TUNED}",
            f"{change} {ON_SUCCESSES}",
            f"{change} {FINE_TUNED}",
        )
    ]


EXHIBIT = Exhibit(
    name="audit_physics",
    title="Audit of appendix I: other readings of it",
    about=(
        "Success [%] on test starts in changed physics as this suite reads appendix I, with the"
        " body named palm in place of the forearm (palm), and with inertia that grows with the"
        " mass (inertia); with the original controller, the tuned one (trained anew on the expert's"
        " episodes there), one tuned on the expert's successes alone, and a fine-tuned one (the"
        " original, trained further on the same episodes as the tuned one)."
    ),
    table=table,
    part="audit",
    axis="",
)
