"""Success of methods that learnt from the first expert of a task, and from the second."""

from functools import partial

import pandas as pd
from matplotlib.figure import Figure

from reports.charts import add_legend, add_line, task_panels
from reports.exhibit import Exhibit
from reports.exhibits.success import success_of
from reports.pairing import keep_common
from reports.results import Results
from reports.style import METHODS, ordered
from reports.tables import in_order, table_of
from tasks.registry import EXPERTS, TASKS

BESIDE = 0.06
"""Distance on the x-axis of a method from the next."""


def by_expert(results: Results, split: str) -> pd.DataFrame:
    """Returns a row for each method under each expert, and a column for each task.

    See `of_both` for which methods and tasks. Letters compare the methods under one expert.
    """
    rows = of_both(results, split)
    if rows.empty:
        return table_of()
    parts = []
    for name in EXPERTS:
        mine = rows[rows.expert == name]
        found = success_of(results.taught_by(name), mine).drop(columns="detectable")
        parts.append(found.assign(method=found.row, expert=name, row=found.row + " " + name))
    order = [f"{method} {name}" for method in METHODS for name in EXPERTS]
    return in_order(pd.concat(parts), order)


def of_both(results: Results, split: str) -> pd.DataFrame:
    """Returns the evaluations of methods and tasks under both experts.

    A method on a task has one size under both: a size that was evaluated under one of them alone
    is left out. They are cut to common seeds and starts.
    """
    if set(results.experts) != set(EXPERTS):
        return results.frame[:0]
    first, second = (results.taught_by(name).rows for name in EXPERTS)
    rows = pd.concat(first.at_one_size([taught.every(split=split) for taught in (first, second)]))
    taught = rows.groupby(["method", "task"]).expert.transform("nunique")
    return keep_common(rows[taught == len(EXPERTS)], ["expert", "method"])


def lines(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a panel for each task: each method's line from the first expert to the second."""
    tasks, methods = ordered(table.column, TASKS), ordered(table.method, METHODS)
    drawing, panels = task_panels(tasks, (2.9, 2), (0.6, 0.6))
    for task, axes in panels.items():
        here = table[table.column == task]
        for place, method in enumerate(methods):
            part = here[here.method == method]
            x = part.expert.map(EXPERTS.index) + BESIDE * (place - (len(methods) - 1) / 2)
            add_line(axes, x, part, method, methods, exhibit)
        axes.set_xticks(range(len(EXPERTS)), EXPERTS)
        axes.set_xlim(-0.4, 1.4)
    drawing.supxlabel("expert", fontsize=10)
    drawing.supylabel(exhibit.axis, fontsize=10)
    add_legend(drawing, exhibit)
    return drawing


PLACES = (
    ("test", "test starts", "from test starts"),
    ("ood", "out of distribution", "out of distribution"),
)
"""Each split, its name in titles, and in sentences."""
EXHIBITS = tuple(
    Exhibit(
        name=f"two_experts_{split}",
        title=f"Success under each of two experts: {place}",
        about=f"Success [%] {starts}, of methods that learnt from the demonstrations of a task's"
        " first or second expert, in a size that ran under both, so not always that of other"
        " tables. The two come from two trainings by one recipe. Letters compare methods under one"
        " expert.",
        table=partial(by_expert, split=split),
        part="robustness",
        figure=lines,
    )
    for split, place, starts in PLACES
)
