"""How far methods stay behind the expert when the hand starts off and actions are late."""

import pandas as pd

from bench.labels import EXPERT
from reports.exhibit import Exhibit
from reports.exhibits.closed_loop import EVERY
from reports.pairs import pairs_of
from reports.results import Results
from reports.style import METHODS
from reports.tables import difference_table, table_of
from tasks.disturbances import TOGETHER


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method, as it is and predicting anew, and a column for each task.

    Only values of two or more seeds are shown.
    """
    replans = sorted(results.frame.replan.unique(), key=lambda replan: (replan > 0, -replan))
    conditions = {"split": "test", "disturbance": TOGETHER}
    found = pd.concat(
        results.rows.at_one_size(
            [results.rows.every(replan=replan, **conditions) for replan in replans]
        )
    )
    if found.empty:
        return table_of()
    often = found.replan.map(lambda replan: f" {EVERY}{replan}" if replan else "")
    found = found.assign(method=found.method + often)
    learnt, experts = found[found.method != EXPERT], found[found.method == EXPERT]
    pairs = [
        pairs_of(results, pd.concat([mine, experts[experts.task == task]])).assign(
            row=method, column=task
        )
        for (task, method), mine in learnt.groupby(["task", "method"])
    ]
    rows = [f"{method} {EVERY}{k}" if k else method for method in METHODS for k in replans]
    return difference_table(pairs, rows)


EXHIBIT = Exhibit(
    name="behind_expert",
    title="Behind the expert, disturbed",
    about="Success on test starts minus that of the expert [points], with joints 0.05 rad off at"
    " the start and actions one control step late; of methods as they are, and predicting anew"
    " every so many control steps. Brackets: 95% intervals of the difference over seeds"
    " (Student's t), not corrected for the number of methods and tasks.",
    table=table,
    part="robustness",
    unit="points",
    axis="",
)
