"""Table 6: hyperparameters of the tracking controller."""

import pandas as pd

from bench.controller_kinds import ORIGINAL
from reports.exhibit import Exhibit
from reports.paper import published
from reports.results import Results

FIELDS = {"learning rate": "learning_rate", "iterations": "epochs"}
"""Field of a controller's config, by column."""


def table(results: Results) -> pd.DataFrame:
    """Returns the learning rate and the iterations. The caption gives layers and activation.

    Where the values differ between tasks, each set of values has a row that names its tasks.
    """
    paper = published("table_6").set_index("column").value
    tasks_by_values = _tasks_by_values(results)
    rows = []
    for number, (values, tasks) in enumerate(tasks_by_values.items(), 1):
        several = len(tasks_by_values) > 1
        row = f"controller {number}: {', '.join(tasks)}" if several else "controller"
        rows += [
            {"row": row, "column": name, "value": value, "published": float(paper[name])}
            for name, value in zip(FIELDS, values, strict=True)
        ]
    return pd.DataFrame(rows, columns=["row", "column", "value", "published"])


def _tasks_by_values(results: Results) -> dict[tuple[float, ...], list[str]]:
    """Returns the tasks whose original controller has the same values, by these values."""
    frame = results.frame
    found = frame[frame.controller == ORIGINAL].drop_duplicates("controller_key")
    tasks: dict[tuple[float, ...], list[str]] = {}
    for task, key in zip(found.task, found.controller_key, strict=True):
        config = results.controller_spec(key)["config"]
        same = tasks.setdefault(tuple(config[name] for name in FIELDS.values()), [])
        if task not in same:
            same.append(task)
    return tasks


EXHIBIT = Exhibit(
    name="table_6",
    title="Table 6: hyperparameters of the tracking controller",
    about=(
        "ReLU layers of 4, 4 and 2 times dim(x_r) units, as published; an iteration is an epoch."
        " The batch size of 32 is this suite's choice."
    ),
    table=table,
    part="audit",
    unit="",
    digits=None,
    axis="",
)
