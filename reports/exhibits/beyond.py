"""Beyond the paper: all methods beside each other, from all starts and in all conditions."""

from functools import partial
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from reports.charts import add_legend, dot_single_fits, errors_of
from reports.episodes import rate_facts
from reports.exhibit import Exhibit
from reports.exhibits.all_tasks import of_all_tasks, of_seeds
from reports.exhibits.success import success_of
from reports.results import Results
from reports.style import INK, METHODS, colour, marker, ordered
from reports.tables import in_order, table_of
from tasks.disturbances import TOGETHER
from tasks.masses import VARIATIONS

CONDITIONS: dict[str, dict[str, Any]] = {
    "test": {},
    "ood": {"split": "ood"},
    **{physics: {"physics": physics} for physics in VARIATIONS},
    **{
        name: {"disturbance": name}
        for name in (
            "joints_off_0.05",
            "joints_off_0.15",
            "hand_push_4",
            "noise_0.03",
            "late_1",
            TOGETHER,
        )
    },
}
"""Those of an evaluation from test starts, where nothing else is said."""


def by_task(results: Results, split: str) -> pd.DataFrame:
    """Returns a row for each method and the expert, and a column for each task."""
    if not results.rows.beyond:
        return table_of()
    return success_of(results, results.rows.of_all(split=split))


def by_condition(results: Results) -> pd.DataFrame:
    """Returns a row for each method with results on all tasks, and a column for each condition."""
    if not results.rows.beyond:
        return table_of()
    parts = results.rows.at_one_size(
        [results.rows.every(**{"split": "test"} | one) for one in CONDITIONS.values()]
    )
    named = [part.assign(condition=name) for name, part in zip(CONDITIONS, parts, strict=True)]
    found = of_all_tasks(pd.concat(named), ["condition", "method"])
    rows = []
    for (name, method), mine in found.groupby(["condition", "method"], sort=False):
        tasks = [*results.episodes.paired(mine, ["task"]).values()]
        if tasks:
            facts = rate_facts(of_seeds(tasks, in_the_middle=False))
            rows.append({"row": method, "column": name} | facts | {"n": tasks[0].shape[1]})
    return in_order(pd.DataFrame(rows), METHODS, [*CONDITIONS]) if rows else table_of()


def by_rows(table: pd.DataFrame, exhibit: Exhibit) -> Figure:
    """Returns a row for each condition, with the success of each method along it."""
    conditions, methods = ordered(table.column, [*CONDITIONS]), ordered(table.row, METHODS)
    drawing = Figure(figsize=(6.4, 0.7 + 0.07 * len(conditions) * (len(methods) + 1)))
    axes = drawing.subplots()
    for place, method in enumerate(methods):
        part = table[table.row == method]
        drawn = axes.errorbar(
            part.value,
            part.column.map(conditions.index) + 0.8 * ((place + 0.5) / len(methods) - 0.5),
            xerr=errors_of(part),
            fmt=marker(method, methods),
            ms=5,
            mec="white",
            mew=0.5,
            elinewidth=0.8,
            color=colour(method, methods),
            label=exhibit.display(method),
        )
        dot_single_fits(drawn, part)
    axes.set_yticks(range(len(conditions)), [exhibit.display(name) for name in conditions])
    axes.set(xlabel=exhibit.axis, xlim=(-2, 102), ylim=(len(conditions) - 0.5, -0.5))
    axes.grid(axis="y", visible=False)
    for edge in range(1, len(conditions)):
        axes.axhline(edge - 0.5, color=INK, lw=0.3)
    add_legend(drawing, exhibit)
    return drawing


EXHIBITS = (
    *(
        Exhibit(
            name=name,
            title=f"Beyond the paper: success {starts}",
            about=f"Success [%] {starts} of the paper's methods, those to beat, and closed-loop"
            " ones, which see each state.",
            table=partial(by_task, split=split),
        )
        for name, split, starts in (
            ("beyond", "test", "from test starts"),
            ("beyond_ood", "ood", "out of distribution"),
        )
    ),
    Exhibit(
        name="beyond_conditions",
        title="Beyond the paper: all conditions",
        about="Success [%], the mean over tasks, from test starts and others, in changed physics"
        " (with the original controller) and disturbed.",
        table=by_condition,
        part="robustness",
        figure=by_rows,
    ),
)
