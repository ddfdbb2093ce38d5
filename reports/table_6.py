"""Table 6: the tracking controller's hyperparameters."""

import pandas as pd

from bench.controller import ControllerConfig
from reports.exhibit import Exhibit
from reports.paper import published
from reports.results import Results


def table(results: Results) -> pd.DataFrame:
    """Returns the learning rate and the iterations; layers and activation are in the caption."""
    config = ControllerConfig()
    values = {"learning rate": config.learning_rate, "iterations": config.epochs}
    paper = published("table_6").set_index("column").value
    rows = [
        {"row": "controller", "column": name, "value": value, "published": float(paper[name])}
        for name, value in values.items()
    ]
    return pd.DataFrame(rows)


EXHIBIT = Exhibit(
    name="table_6",
    title="Table 6: hyperparameters of the tracking controller",
    about=(
        "ReLU layers of 4, 4 and 2 times dim(x_r) units, as published; an iteration is an epoch."
        " The batch size of 32 is this suite's choice."
    ),
    table=table,
    unit="",
    digits=None,
    axis="",
    figure=None,
)
