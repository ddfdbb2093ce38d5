"""The paper's numbers in `reports/published`, against a second transcription."""

import re
from pathlib import Path

import numpy as np
import pytest

from reports.paper import published

TABLES = (1, 2, 3, 4, 5, 7, 8, 9, 10, 11, 12)
LINES = Path(__file__).with_name("appendix_tables.txt").read_text().splitlines()[1:]


def rows_of(number):
    """Returns the numbers of each row of a table, as (value, spread)."""
    rows = [line.split(": ")[1] for line in LINES if line.startswith(f"{number}: ")]
    cells = [re.findall(r"([\d.]+)(?:\(±([\d.]+)\))?", row) for row in rows]
    return [[(float(v), float(s) if s else np.nan) for v, s in row] for row in cells]


@pytest.mark.parametrize("number", TABLES)
def test_every_number_equals_the_appendix(number):
    frame = published(f"table_{number}")
    found = [part for _, part in frame.groupby("row", sort=False)]
    expected = rows_of(number)
    assert len(found) == len(expected)
    for part, row in zip(found, expected, strict=True):
        if len(row) < len(part):
            assert part.value.isna().all()
            assert part.note.str.contains("three numbers for four columns").all()
            continue
        np.testing.assert_array_equal(part[["value", "spread"]].to_numpy(float), row)


def test_only_the_expert_of_table_7_is_missing():
    missing = [
        (number, row)
        for number in TABLES
        for row in published(f"table_{number}").query("value.isna()").row.unique()
    ]
    assert missing == [(7, "expert")]
