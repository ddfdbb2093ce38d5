"""Audit of appendix C: the same motions, judged by the success rule of the published code."""

import pandas as pd

from reports.exhibit import Exhibit
from reports.results import Results
from reports.style import METHODS
from reports.tables import in_order, success_table, table_of
from tasks.registry import APPENDIX, JUDGED_OTHERWISE, PUBLISHED, rules


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method, and a column for each task and success rule."""
    parts = []
    for task in JUDGED_OTHERWISE:
        published, appendix = results.rows.at_one_size(
            [results.rows.select(task=task, split="test", rule=r) for r in (PUBLISHED, APPENDIX)]
        )
        parts += [appendix[appendix.folder.isin(published.folder)], published]
    found = pd.concat(parts)
    if found.empty:
        return table_of()
    found = found.assign(label=found.task + " " + found.rule)
    columns = [f"{task} {rule}" for task in JUDGED_OTHERWISE for rule in rules(task)]
    return in_order(success_table(results, found, "method", "label"), METHODS, columns)


EXHIBIT = Exhibit(
    name="audit_rule",
    title="Audit of appendix C: when an episode succeeds",
    about=(
        "Success [%] of the same fits on the same test starts, judged by appendix C and by the"
        " rule of the published code: tool after 30 control steps instead of 99; in reorientation"
        " the pen must also be held and slow after the last step."
    ),
    table=table,
    part="audit",
)
