"""Figure 6, center and right: what the set of observables does to imitation error and success."""

import pandas as pd
from matplotlib.figure import Figure

from reports.exhibit import Exhibit, add_legend, errors_of
from reports.results import Results
from reports.style import colour, display
from reports.table_11 import SETS

ERROR = "imitation error [rad, m]"
PANELS = (ERROR, "success [%]")


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each set and quantity, and a column for each task."""
    rows = []
    tested = {v: results.main(method="kodex", variant=v, split="test") for v in SETS}
    rates = results.rates(pd.concat(tested.values()), ["variant", "task"])
    for variant, name in SETS.items():
        found = tested[variant]
        success = rates[rates.variant == variant].rename(columns={"task": "column"})
        rows += success.assign(row=f"{name}: success [%]").to_dict("records")
        for one in found.drop_duplicates("task").itertuples():
            error = results.imitation_error(one.folder)
            rows.append({"row": f"{name}: {ERROR}", "column": one.task, "value": error})
    return pd.DataFrame(rows, columns=["row", "column", "value", "low", "high", "n", "diverged"])


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns two panels, sets along the axis, one line a task."""
    drawing = Figure(figsize=(6.4, 3.2))
    parts = table.row.str.split(": ", n=1, expand=True)
    for axes, quantity in zip(drawing.subplots(1, 2), PANELS, strict=True):
        tasks = table.column.drop_duplicates().tolist()
        for place, task in enumerate(tasks):
            chosen = table[(parts[1] == quantity) & (table.column == task)]
            names = parts[0][chosen.index]
            axes.errorbar(
                names,
                chosen.value,
                errors_of(chosen),
                marker="o^sD"[place],
                capsize=2,
                color=colour(task, tasks),
                label=display(task),
            )
        axes.set(ylabel=quantity, ylim=(0, 1.08 * axes.get_ylim()[1]))
    add_legend(drawing, exhibit)
    return drawing


EXHIBIT = Exhibit(
    name="figure_6",
    title="Figure 6: the choice of observables",
    about=(
        "Mean absolute error of the predicted joints on the validation demonstrations, t = 2..T;"
        " success [%] on unseen starts. Published: figure only."
    ),
    table=table,
    part="KODex inside",
    unit="",
    digits=3,
    figure=figure,
    of=("kodex",),
)
