"""Figure 7: how often eigenvalue magnitudes of K occur."""

from itertools import pairwise

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from reports.exhibit import Exhibit
from reports.results import Results
from reports.style import colour, display
from reports.table_12 import magnitudes

EDGES = np.linspace(0, 1.1, 23)
"""Of the intervals; the last one holds all that is larger, too."""
LARGEST = f"{EDGES[-2]:.2f} and above"


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each interval of magnitudes and a column for each task: how many."""
    names = [f"{low:.2f} to {high:.2f}" for low, high in pairwise(EDGES[:-1])] + [LARGEST]
    rows = []
    for task, values in magnitudes(results).items():
        counts, _ = np.histogram(np.minimum(values, EDGES[-1]), EDGES)
        rows += [
            {"row": name, "column": task, "value": float(count)}
            for name, count in zip(names, counts, strict=True)
        ]
    return pd.DataFrame(rows, columns=["row", "column", "value"])


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns one histogram a task."""
    tasks = table.column.drop_duplicates().tolist()
    drawing = Figure(figsize=(2.4 * len(tasks) + 0.6, 2.6), layout="constrained")
    panels = drawing.subplots(1, len(tasks), sharey=True, squeeze=False)[0]
    for axes, task in zip(panels, tasks, strict=True):
        counts = table[table.column == task].value
        axes.stairs(counts, EDGES, fill=True, color=colour(task, tasks))
        axes.axvline(1, color="black", lw=0.8, ls="--")
        axes.set(title=display(task), xlabel=f"magnitude\n(last bin: {LARGEST})")
    panels[0].set_ylabel("eigenvalues")
    return drawing


EXHIBIT = Exhibit(
    name="figure_7",
    title="Figure 7: eigenvalue magnitudes",
    about="Eigenvalues of K by magnitude; beyond the dashed line at 1 a mode grows. Published:"
    " figure only.",
    table=table,
    unit="",
    digits=0,
    figure=figure,
    of=("kodex",),
)
