"""Figure 6, center and right: imitation error and success by set of observables."""

from functools import partial
from itertools import cycle

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from reports.charts import add_legend, by_row, dot_single_fits, errors_of
from reports.diagnostics import imitation_error
from reports.episodes import RATE
from reports.exhibit import Exhibit
from reports.exhibits.table_11 import SETS
from reports.pairing import keep_common
from reports.results import Results
from reports.style import colour, display
from reports.tables import table_of

ERROR = "imitation error [rad, m]"
SUCCESS = "success [%]"
PANELS = (ERROR, SUCCESS)
SPACING = 0.08
"""Distance of the tasks' points of one set, so that their intervals do not cover each other."""


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each set and quantity, and a column for each task.

    Both are of the same seeds: the mean of success, and the median of the error, since a single
    diverging prediction would make a mean of any size.
    """
    found = pd.concat(results.rows.main(method="kodex", variant=v, split="test") for v in SETS)
    if found.empty:
        return table_of()
    found = keep_common(found, ["variant"])
    rates = results.episodes.rates(found, ["variant", "task"])
    parts = []
    for variant, name in SETS.items():
        if variant not in set(found.variant):
            continue
        success = rates[rates.variant == variant].drop(columns="variant")
        parts.append(success.assign(row=f"{name}: {SUCCESS}"))
        mine = found[found.variant == variant]
        errors = mine.folder.map(partial(imitation_error, results)).fillna(np.inf)
        errors = errors.groupby(mine.task, sort=False).median()
        error = errors.rename("value").reset_index()
        parts.append(error.assign(row=f"{name}: {ERROR}"))
    whole = pd.concat(parts, ignore_index=True).rename(columns={"task": "column"})
    return whole[["row", "column", *RATE, "diverged"]]


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a panel for each quantity, with the sets along the axis and a line for each task."""
    drawing = Figure(figsize=(6.4, 3.2))
    parts = table.row.str.split(": ", n=1, expand=True)
    tasks, sets = table.column.drop_duplicates().tolist(), parts[0].drop_duplicates().tolist()
    for axes, quantity in zip(drawing.subplots(1, 2), PANELS, strict=True):
        shown = table[parts[1] == quantity].assign(row=table.column, column=parts[0])
        looks = zip(by_row(shown, tasks, sets, SPACING), cycle("o^sD"), strict=False)
        for (task, x, values), marker in looks:
            drawn = axes.errorbar(
                x,
                values.value,
                errors_of(values),
                marker=marker,
                capsize=2,
                color=colour(task, tasks),
                label=display(task),
            )
            dot_single_fits(drawn, values)
        axes.set(ylabel=quantity, ylim=(0, 1.08 * axes.get_ylim()[1]))
        axes.set(xticks=range(len(sets)), xticklabels=sets, xlim=(-0.5, len(sets) - 0.5))
    add_legend(drawing, exhibit)
    return drawing


EXHIBIT = Exhibit(
    name="figure_6",
    title="Figure 6: the choice of observables",
    about=(
        "Mean absolute error of the predicted joints on the validation demonstrations, t = 2..T;"
        " success [%] on test starts. The error is the median over seeds, since a diverging"
        " prediction makes a mean of any size; success is their mean."
        " The paper has a figure without numbers."
    ),
    table=table,
    part="KODex inside",
    unit="",
    digits=3,
    figure=figure,
    subjects=("kodex",),
)
