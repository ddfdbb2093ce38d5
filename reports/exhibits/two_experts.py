"""Success of methods that learnt from the first expert of a task, and from the second."""

from functools import partial

import pandas as pd
from matplotlib.figure import Figure

from reports.charts import add_legend, add_line, task_panels
from reports.exhibit import Exhibit
from reports.pairing import keep_common
from reports.results import Results
from reports.style import METHODS, ordered
from reports.tables import in_order, success_table, table_of
from tasks.registry import EXPERTS, TASKS

BESIDE = 0.06
"""Distance on the x-axis of a method from the next."""


def by_expert(results: Results, split: str) -> pd.DataFrame:
    """Returns a row for each method under each expert, and a column for each task.

    Only methods and tasks with results under both experts are shown, on common seeds and starts.
    """
    if set(results.experts) != set(EXPERTS):
        return table_of()
    taught = {name: results.taught_by(name) for name in EXPERTS}
    rows = pd.concat(one.rows.of_all(split=split) for one in taught.values())
    common = keep_common(rows, ["expert", "method"])
    parts = []
    for name, one in taught.items():
        found = success_table(one, common[common.expert == name], "method", "task")
        parts.append(found.assign(method=found.row, expert=name, row=found.row + " " + name))
    table = pd.concat(parts)
    both = table.groupby(["method", "column"]).expert.transform("nunique") == len(EXPERTS)
    order = [f"{method} {name}" for method in METHODS for name in EXPERTS]
    return in_order(table[both], order)


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


EXHIBITS = tuple(
    Exhibit(
        name=f"two_experts_{split}",
        title=f"Success under each of two experts: {place}",
        about=f"Success [%] {starts}, of methods that learnt from the demonstrations of a task's"
        " first or second expert. The two come from separate trainings, whose settings may differ.",
        table=partial(by_expert, split=split),
        part="robustness",
        figure=lines,
    )
    for split, place, starts in (
        ("test", "test starts", "from test starts"),
        ("ood", "out of distribution", "out of distribution"),
    )
)
