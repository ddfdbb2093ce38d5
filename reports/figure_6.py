"""Figure 6: what the set of observables does to training time, imitation error and success."""

import pandas as pd
from matplotlib.figure import Figure

from reports.exhibit import Exhibit
from reports.results import Results, rates
from reports.style import colour, display
from reports.table_11 import SETS

PANELS = {"fit time [s]": "", "imitation error [rad, m]": "", "success [%]": "%"}


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each set and quantity, and a column for each task."""
    rows = []
    for variant, name in SETS.items():
        found = results.main(method="kodex", variant=variant, split="test")
        success = rates(found, ["task"]).rename(columns={"task": "column"})
        rows += success.assign(row=f"{name}: success [%]").to_dict("records")
        for one in found.itertuples():
            errors = results.diagnostics(one.folder)["imitation_error"]
            values = {"fit time [s]": one.fit_seconds, "imitation error [rad, m]": errors.mean()}
            rows += [
                {"row": f"{name}: {quantity}", "column": one.task, "value": float(value)}
                for quantity, value in values.items()
            ]
    return pd.DataFrame(rows, columns=["row", "column", "value", "low", "high", "n", "diverged"])


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns three panels, sets along the axis, one line a task."""
    drawing = Figure(figsize=(9.5, 3.0), layout="constrained")
    parts = table.row.str.split(": ", n=1, expand=True)
    for axes, quantity in zip(drawing.subplots(1, 3), PANELS, strict=True):
        for place, task in enumerate(table.column.drop_duplicates()):
            chosen = table[(parts[1] == quantity) & (table.column == task)]
            names = parts[0][chosen.index]
            axes.plot(
                names,
                chosen.value,
                "o^sD"[place] + "-",
                color=colour(task, place),
                label=display(task),
            )
        axes.set(ylabel=quantity, ylim=(0, None))
    drawing.legend(*axes.get_legend_handles_labels(), frameon=False, loc="outside right upper")
    return drawing


EXHIBIT = Exhibit(
    name="figure_6",
    title="Figure 6: the choice of observables",
    about=(
        "Fit time of K, lifting included; mean absolute error of the predicted joints on the"
        " validation demonstrations, t = 2..T; success [%] on unseen starts. Published: figure"
        " only."
    ),
    table=table,
    unit="",
    digits=3,
    figure=figure,
)
