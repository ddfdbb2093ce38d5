"""Success of methods that predict their motion anew on the way."""

from math import inf

import pandas as pd
from matplotlib.figure import Figure

from reports.charts import add_legend, add_line, panel_grid
from reports.exhibit import Exhibit
from reports.results import Results
from reports.style import METHODS, display, ordered
from reports.tables import in_order, success_table, table_of
from tasks.disturbances import REPLANNED, UNDISTURBED
from tasks.masses import NOMINAL, VARIATIONS
from tasks.registry import TASKS

NEVER, EVERY = "once", "every_"


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method, condition and interval, and a column for each task."""
    found = results.frame[(results.frame.split == "test") & (results.frame.replan > 0)]
    conditions = found[["physics", "disturbance"]].drop_duplicates().to_dict("records")
    replans = sorted(found.replan.unique(), reverse=True)
    parts = results.rows.at_one_size(
        [
            results.rows.select(split="test", replan=replan, **condition)
            for condition in conditions
            for replan in (0, *replans)
        ]
    )
    kept = [part[part.method.isin(found.method)] for part in parts]
    if not kept:
        return table_of()
    shown = pd.concat(kept)
    place = shown.physics.where(shown.disturbance == UNDISTURBED, shown.disturbance)
    often = shown.replan.map(lambda replan: f"{EVERY}{replan}" if replan else NEVER)
    label = shown.method + " " + place + " " + often
    intervals = (NEVER, *(f"{EVERY}{replan}" for replan in replans))
    rows = [
        f"{method} {name} {when}"
        for method in METHODS
        for name in ordered(place, (NOMINAL, *REPLANNED, *VARIATIONS))
        for when in intervals
    ]
    rates = in_order(success_table(results, shown.assign(label=label), "label", "task"), rows)
    rates[["method", "place", "often"]] = rates.row.str.split(" ", expand=True)
    return rates


def in_nominal_physics(table: pd.DataFrame) -> pd.DataFrame:
    """Returns the rows without changed physics."""
    return table[table.place.isin((NOMINAL, *REPLANNED))]


def figure(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a row of panels for each condition: success by interval, a panel for each task."""
    table = in_nominal_physics(table)
    tasks, methods = ordered(table.column, TASKS), ordered(table.method, METHODS)
    places = table.place.drop_duplicates().tolist()
    intervals = sorted(table.often.unique(), key=_steps_between, reverse=True)
    drawing, panels = panel_grid(len(places), len(tasks), (0.8, 0.8))
    for place, row in zip(places, panels, strict=True):
        for task, axes in zip(tasks, row, strict=True):
            here = table[(table.place == place) & (table.column == task)]
            for method in methods:
                part = here[here.method == method]
                add_line(axes, part.often.map(intervals.index), part, method, methods, exhibit)
        row[0].set_ylabel(display(place).replace("+", " +\n"))
    for task, first, last in zip(tasks, panels[0], panels[-1], strict=True):
        first.set_title(display(task), fontsize=10)
        last.set_xticks(range(len(intervals)), [name.removeprefix(EVERY) for name in intervals])
    drawing.supxlabel("control steps between two predictions", fontsize=10)
    drawing.supylabel(exhibit.axis, fontsize=10)
    add_legend(drawing, exhibit)
    return drawing


def _steps_between(often: str) -> float:
    return inf if often == NEVER else int(often.removeprefix(EVERY))


EXHIBIT = Exhibit(
    name="closed_loop",
    title="Predicting anew on the way",
    about="Success [%] on test starts of methods whose motion is predicted once, from the start, or"
    " anew from the present state every so many control steps. Changed physics: in the CSV file.",
    table=table,
    part="robustness",
    figure=figure,
    summary=in_nominal_physics,
)
