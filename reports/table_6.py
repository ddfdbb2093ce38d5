"""Table 6: the tracking controller's hyperparameters."""

import pandas as pd

from bench.controller_kinds import ORIGINAL
from reports.exhibit import Exhibit
from reports.paper import published
from reports.results import Results

COLUMNS = {"learning rate": "learning_rate", "iterations": "epochs"}
"""What is shown, under its name in a controller's config."""


def table(results: Results) -> pd.DataFrame:
    """Returns the learning rate and the iterations; layers and activation are in the caption.

    Where tasks have other values, each kind of controller has a row that names its tasks.
    """
    paper = published("table_6").set_index("column").value
    kinds = _kinds(results)
    rows = []
    for number, (values, tasks) in enumerate(kinds.items(), 1):
        row = "controller" if len(kinds) == 1 else f"controller {number}: {', '.join(tasks)}"
        rows += [
            {"row": row, "column": name, "value": value, "published": float(paper[name])}
            for name, value in zip(COLUMNS, values, strict=True)
        ]
    return pd.DataFrame(rows, columns=["row", "column", "value", "published"])


def _kinds(results: Results) -> dict[tuple[float, ...], list[str]]:
    """By the values of the columns, the tasks whose original controller has them."""
    frame = results.frame
    found = frame[frame.controller == ORIGINAL].drop_duplicates("controller_key")
    kinds: dict[tuple[float, ...], list[str]] = {}
    for task, key in zip(found.task, found.controller_key, strict=True):
        config = results.controller_spec(key)["config"]
        tasks = kinds.setdefault(tuple(config[name] for name in COLUMNS.values()), [])
        if task not in tasks:
            tasks.append(task)
    return kinds


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
