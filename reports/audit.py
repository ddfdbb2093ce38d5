"""Audit: each method as described, as published, and in other readings of the paper."""

import pandas as pd

from bench.controller import UNCLIPPED
from reports.exhibit import FROM_PAPER, Exhibit, panels, success_table
from reports.paper import published
from reports.results import Results
from reports.style import METHODS
from reports.table_11 import SETS

COMPARED = ("described", "published")
"""The variants that the paper's numbers stand beside."""


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
    label = found.method + " " + found.variant
    return _beside_the_paper(success_table(found.assign(label=label), "label", "task"))


def _beside_the_paper(table: pd.DataFrame) -> pd.DataFrame:
    """With the paper's success of a method, at its best size, beside what is compared with it."""
    parts = []
    for number, method in enumerate(METHODS[1:], 1):
        numbers = published(f"table_{number}").rename(
            columns={"value": "published", "spread": "published spread"}
        )
        best = numbers.loc[numbers.groupby("column").published.idxmax()]
        parts += [best.assign(row=f"{method} {variant}") for variant in COMPARED]
    paper = pd.concat(parts)[["row", "column", *FROM_PAPER]]
    return table.merge(paper, on=["row", "column"], how="left")


EXHIBIT = Exhibit(
    name="audit",
    title="Audit: as described and as published",
    about=(
        "Success [%] on unseen starts of each variant. As published means: trained as the"
        " authors' code does; unclipped: with a controller of the expert's actions as given. The"
        " paper's: its best size, from the starts of its validation demonstrations."
    ),
    table=table,
    figure=panels,
)
