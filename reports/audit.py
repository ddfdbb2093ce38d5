"""Audit: each method as described, as published, and in other readings of the paper."""

import pandas as pd

from bench.controller_kinds import UNCLIPPED
from reports.exhibit import Exhibit, beside, in_order, panels, success_table
from reports.paper import published
from reports.results import Results
from reports.style import METHODS, ordered
from reports.table_11 import SETS

COMPARED = ("described", "published")
"""The variants that the paper's numbers stand beside."""


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method and variant, and a column for each task."""
    frame = results.frame
    variants = [v for v in frame.variant.unique() if v == "described" or v not in SETS]
    unclipped = results.main(controller=UNCLIPPED, split="test")
    parts = [results.main(variant=v, split="test") for v in variants]
    found = pd.concat([*parts, unclipped.assign(variant=UNCLIPPED)])
    found = found[found.method != "expert"]
    if found.variant.nunique() < 2:
        return pd.DataFrame(columns=["row", "column", "value"])
    label = found.method + " " + found.variant
    rows = [f"{m} {v}" for v in ordered(found.variant, COMPARED) for m in METHODS[1:]]
    success = in_order(success_table(results, found.assign(label=label), "label", "task"), rows)
    return beside(success, _best_published())


def _best_published() -> pd.DataFrame:
    """The paper's success of each method at its best size, for each variant it stands beside."""
    parts = []
    for number, method in enumerate(METHODS[1:], 1):
        numbers = published(f"table_{number}")
        best = numbers.loc[numbers.groupby("column").value.idxmax()]
        parts += [best.assign(row=f"{method} {variant}") for variant in COMPARED]
    return pd.concat(parts)


EXHIBIT = Exhibit(
    name="audit",
    title="Audit: as described and as published",
    about=(
        "Success [%] on unseen starts of each variant. As published means: trained as the"
        " authors' code does; unclipped: with a controller of the expert's actions as given. The"
        " paper's: its best size, from the starts of its validation demonstrations."
    ),
    table=table,
    part="audit",
    figure=panels,
)
