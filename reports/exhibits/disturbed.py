"""Success when hand, object, sensors or actions are not as they should be."""

import pandas as pd
from matplotlib.figure import Figure

from reports.charts import add_legend, add_line, panel_grid
from reports.exhibit import Exhibit
from reports.results import Results
from reports.style import METHODS, display, ordered
from reports.tables import in_order, success_table, table_of
from tasks.disturbances import KINDS, TOGETHER, UNDISTURBED, all_names
from tasks.registry import TASKS

AXES = {
    "joints_off": "joints off",
    "object_off": "object off",
    "hand_push": "push on hand",
    "object_push": "push on object",
    "noise": "noise",
    "late": "late",
}


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method and disturbance, and a column for each task."""
    names = all_names()
    plain, *parts = results.rows.at_one_size(
        [results.rows.every(split="test", disturbance=name) for name in (UNDISTURBED, *names)]
    )
    disturbed = pd.concat(parts)
    if disturbed.empty:
        return table_of()
    found = pd.concat([plain[plain.folder.isin(disturbed.folder)], disturbed])
    label = found.method + " " + found.disturbance
    rows = [f"{method} {name}" for method in METHODS for name in (UNDISTURBED, *names)]
    rates = in_order(success_table(results, found.assign(label=label), "label", "task"), rows)
    parts = rates.row.str.rsplit(" ", n=1, expand=True)
    one = parts[1].where(parts[1] != TOGETHER, "")
    kinds = one.str.rsplit("_", n=1, expand=True)
    strength = pd.to_numeric(kinds[1]).fillna(0.0)
    return rates.assign(method=parts[0], kind=kinds[0], strength=strength)


def weakest(table: pd.DataFrame) -> pd.DataFrame:
    """Returns the rows of the weakest strength of each kind, and of those that come together."""
    least = table.kind.map({kind: about.strengths[0] for kind, about in KINDS.items()})
    return table[least.isna() | (table.strength == least)]


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a row of panels for each task: success by strength, a panel for each kind."""
    tasks, methods = ordered(table.column, TASKS), ordered(table.method, METHODS)
    kinds = [kind for kind in KINDS if kind in set(table.kind)]
    drawing, panels = panel_grid(len(tasks), len(kinds), (0.6, 0.8), "col")
    for task, row in zip(tasks, panels, strict=True):
        for kind, axes in zip(kinds, row, strict=True):
            here = table[(table.column == task) & table.kind.isin([UNDISTURBED, kind])]
            if (here.kind == kind).any():
                for method in methods:
                    part = here[here.method == method].sort_values("strength")
                    add_line(axes, part.strength, part, method, methods, exhibit)
            else:
                axes.set_axis_off()
        row[0].set_ylabel(display(task), fontweight="bold")
    for kind, axes in zip(kinds, panels[-1], strict=True):
        axes.set_xlabel(f"{AXES[kind]} [{KINDS[kind].unit}]")
    drawing.supylabel(exhibit.axis, fontsize=10)
    add_legend(drawing, exhibit)
    return drawing


EXHIBIT = Exhibit(
    name="disturbed",
    title="Disturbed",
    about="Success [%] on test starts when something is off, by its strength: normal errors of the"
    " hinges of the hand at the start, of the object's place, of what is read; a push at a random"
    " step of the first half; actions that arrive late. All methods meet the same. A hyphen"
    " stands where a task has no such disturbance. Stronger ones: in the figure and the CSV file.",
    table=table,
    part="robustness",
    figure=figure,
    summary=weakest,
)
