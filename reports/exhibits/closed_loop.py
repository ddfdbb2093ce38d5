"""Success of methods that predict their motion anew on the way."""

import pandas as pd

from reports.exhibit import Exhibit
from reports.results import Results
from reports.style import METHODS
from reports.tables import in_order, success_table, table_of
from tasks.disturbances import UNDISTURBED

NEVER = "once"


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method, condition and interval, and a column for each task."""
    found = results.frame[(results.frame.split == "test") & (results.frame.replan > 0)]
    conditions = found[["physics", "disturbance"]].drop_duplicates().to_dict("records")
    replans = sorted(found.replan.unique(), reverse=True)
    parts = [
        results.main(split="test", replan=replan, **condition).assign(rank=rank)
        for rank, condition in enumerate(conditions)
        for replan in (0, *replans)
    ]
    kept = [part[part.method.isin(found.method)] for part in parts]
    if not kept:
        return table_of()
    shown = pd.concat(kept)
    place = shown.physics.where(shown.disturbance == UNDISTURBED, shown.disturbance)
    often = shown.replan.map(lambda replan: f"every_{replan}" if replan else NEVER)
    label = shown.method + " " + place + " " + often
    rows = [
        f"{method} {name} {when}"
        for method in METHODS
        for name in place.drop_duplicates()
        for when in (NEVER, *(f"every_{replan}" for replan in replans))
    ]
    return in_order(success_table(results, shown.assign(label=label), "label", "task"), rows)


EXHIBIT = Exhibit(
    name="closed_loop",
    title="Predicting anew on the way",
    about="Success [%] on test starts of methods whose motion is predicted once, from the start, or"
    " anew from the present state every so many control steps.",
    table=table,
    part="robustness",
    axis="",
)
