"""Audit of the methods: as described, as published, and in other variants."""

import pandas as pd

from bench.controller_kinds import UNCLIPPED
from methods.registry import PAPER
from reports.charts import panels
from reports.exhibit import Exhibit
from reports.exhibits.table_11 import SETS
from reports.pairing import without_expert
from reports.paper import published, with_numbers
from reports.results import Results
from reports.style import METHODS, ordered
from reports.tables import in_order, success_table, table_of

COMPARED = ("described", "published")
"""The variants beside which the paper's numbers are shown."""


def table(results: Results) -> pd.DataFrame:
    """Returns a row for each method and variant, and a column for each task."""
    variants = [v for v in results.frame.variant.unique() if v == "described" or v not in SETS]
    unclipped, *parts = results.rows.at_one_size(
        [
            results.rows.select(controller=UNCLIPPED, split="test"),
            *(results.rows.select(variant=v, split="test") for v in variants),
        ]
    )
    found = without_expert(pd.concat([*parts, unclipped.assign(variant=UNCLIPPED)]))
    if found.variant.nunique() < 2:
        return table_of()
    label = found.method + " " + found.variant
    rows = [f"{m} {v}" for v in ordered(found.variant, COMPARED) for m in METHODS[1:]]
    success = in_order(success_table(results, found.assign(label=label), "label", "task"), rows)
    return with_numbers(success, _best_published())


def _best_published() -> pd.DataFrame:
    """Returns the paper's success of each method at its best size, for each compared variant."""
    parts = []
    for number, method in enumerate(PAPER, 1):
        numbers = published(f"table_{number}")
        best = numbers.loc[numbers.groupby("column").value.idxmax()]
        parts += [best.assign(row=f"{method} {variant}") for variant in COMPARED]
    return pd.concat(parts)


EXHIBIT = Exhibit(
    name="audit_variant",
    title="Audit: as described and as published",
    about=(
        "Success [%] on test starts of each variant. Published: trained as the authors' code does."
        " Unclipped: with a controller that learnt from the expert's actions before clipping. The"
        " paper's numbers: each method's best size, from the starts of its validation"
        " demonstrations."
    ),
    table=table,
    part="audit",
    figure=panels,
)
