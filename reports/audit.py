"""Audit: each method as described, as published, and in other readings of the paper."""

import pandas as pd

from bench.controller import UNCLIPPED
from reports.exhibit import Exhibit, panels, success_table
from reports.results import Results
from reports.table_11 import SETS


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method and variant, and a column for each task."""
    frame = results.frame
    variants = [v for v in frame.variant.unique() if v == "described" or v not in SETS]
    found = pd.concat([results.main(variant=v, split="test") for v in variants])
    unclipped = results.main(controller=UNCLIPPED, split="test")
    found = pd.concat([found, unclipped.assign(variant=UNCLIPPED)])
    found = found[found.method != "expert"]
    if found.variant.nunique() < 2:
        return pd.DataFrame(columns=["row", "column", "value"])
    return success_table(found.assign(label=found.method + " " + found.variant), "label", "task")


EXHIBIT = Exhibit(
    name="audit",
    title="Audit: as described and as published",
    about=(
        "Success [%] on unseen starts of each variant. As published means: trained as the"
        " authors' code does; unclipped: with a controller of the expert's actions as given."
    ),
    table=table,
    figure=panels,
)
