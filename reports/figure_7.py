"""Figure 7: how often eigenvalue magnitudes of K occur."""

from itertools import pairwise

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from reports.exhibit import Exhibit
from reports.results import Results
from reports.style import INK, colour, display
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
    lines, columns = -(-len(tasks) // 2), min(len(tasks), 2)
    drawing = Figure(figsize=(2.9 * columns + 0.6, 2 * lines + 0.6))
    panels = drawing.subplots(lines, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for empty in panels[len(tasks) :]:
        empty.remove()
    for axes, task in zip(panels[: len(tasks)], tasks, strict=True):
        counts = table[table.column == task].value
        axes.stairs(counts, EDGES, fill=True, color=colour(task, tasks))
        axes.axvline(1, color=INK, lw=0.8, ls="--")
        axes.set_title(display(task), fontsize=10, loc="left")
    drawing.supxlabel(f"magnitude (last bin: {LARGEST})", fontsize=10)
    drawing.supylabel("eigenvalues", fontsize=10)
    return drawing


EXHIBIT = Exhibit(
    name="figure_7",
    title="Figure 7: eigenvalue magnitudes",
    about="Eigenvalues of K by magnitude; beyond the dashed line at 1 a mode grows. Published:"
    " figure only.",
    table=table,
    part="KODex inside",
    unit="",
    digits=0,
    figure=figure,
    of=("kodex",),
)
