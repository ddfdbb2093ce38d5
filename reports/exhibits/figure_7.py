"""Figure 7: histogram of the eigenvalue magnitudes of K."""

from itertools import pairwise

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from reports.charts import task_panels
from reports.exhibit import Exhibit
from reports.exhibits.table_12 import magnitudes_by_task
from reports.results import Results
from reports.style import INK, colour
from reports.tables import table_of

EDGES = np.linspace(0, 1.1, 23)
"""Edges of the bins. The last bin also holds all larger magnitudes."""
LARGEST = f"{EDGES[-2]:.2f} and above"


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each bin and a column for each task: the number of eigenvalues of a K.

    It is the mean over seeds.
    """
    names = [f"{low:.2f} to {high:.2f}" for low, high in pairwise(EDGES[:-1])] + [LARGEST]
    rows = []
    for task, values in magnitudes_by_task(results).items():
        counts, _ = np.histogram(np.minimum(values, EDGES[-1]), EDGES)
        rows += [
            {"row": name, "column": task, "value": float(count), "seeds": len(values)}
            for name, count in zip(names, counts / len(values), strict=True)
        ]
    return table_of(rows)


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a histogram for each task."""
    tasks = table.column.drop_duplicates().tolist()
    drawing, panels = task_panels(tasks, (2.9, 2), (0.6, 0.6), sharex=True)
    for task, axes in panels.items():
        axes.stairs(table[table.column == task].value, EDGES, fill=True, color=colour(task, tasks))
        axes.axvline(1, color=INK, lw=0.8, ls="--")
    drawing.supxlabel(f"magnitude (last bin: {LARGEST})", fontsize=10)
    drawing.supylabel("eigenvalues", fontsize=10)
    return drawing


EXHIBIT = Exhibit(
    name="figure_7",
    title="Figure 7: eigenvalue magnitudes",
    about="Eigenvalues of K by magnitude, mean count over seeds. Modes grow beyond the dashed line"
    " at 1. Directions that the cut-off removed are among those at 0."
    " The paper has a figure without numbers.",
    table=table,
    part="KODex inside",
    unit="",
    digits=0,
    figure=figure,
    subjects=("kodex",),
)
