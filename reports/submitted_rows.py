"""The submitted rows that the page of the shipped results shows below the suite's own.

They are files of `bench submit` in the folder `SUBMITTED`, beside a list of those that a maintainer
has repeated. A file that cannot stand beside the shipped results is left out, with the reason.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from bench.controller_kinds import NO_CONTROLLER
from bench.submission import Submission
from reports.comparable import check_comparable, main_rows, required
from reports.exhibits.success import success_of
from reports.results import Results
from tasks.errors import InputError
from tasks.words import count_of

SUBMITTED = Path(__file__).with_name("submitted")
"""Folder of the rows that are shipped."""
LIST = "verified.toml"


@dataclass(frozen=True)
class SubmittedRow:
    """A row that can stand beside the shipped results."""

    results: Results
    evaluations: pd.DataFrame
    """On test starts, as many as the shipped methods have."""
    table: pd.DataFrame
    """Success of the row, as `reports.exhibits.success.success_of` returns it."""
    name: str
    mark: str
    """``submitted`` or ``verified``."""
    note: str
    """A sentence on its origin."""


@dataclass(frozen=True)
class Submitted:
    """The rows of a folder."""

    rows: Sequence[SubmittedRow] = ()
    refused: Mapping[str, str] = field(default_factory=dict)
    """By name of the file, why it is left out."""


def submitted_rows(reference: Results, folder: Path) -> Submitted:
    """Returns the rows of a folder, by name of the file.

    Args:
        reference: the shipped results.
        folder: of the files, such as `SUBMITTED`.
    """
    rows, refused, needed = [], {}, required(reference)
    try:
        verified = _verified(folder / LIST)
    except InputError as error:
        verified, refused[LIST] = {}, str(error)
    for path in sorted(folder.glob("*.parquet")):
        try:
            results = Results(path)
            check_comparable(results, reference, needed)
            rows.append(_row(results, needed, verified))
        except InputError as error:
            refused[path.name] = str(error)
    return Submitted(rows, refused)


def _row(results: Results, needed: pd.DataFrame, verified: Mapping[str, Any]) -> SubmittedRow:
    submission = results.source
    assert isinstance(submission, Submission)
    origin = submission.origin
    rows = main_rows(results, origin.method)
    rows = rows[rows.split == "test"]
    starts = needed[needed.split == "test"].groupby("task").episodes.min()
    rows = rows.assign(episodes=rows.task.map(starts))
    note = f"{submission.label}: {origin.package.name} {origin.package.version}"
    if (rows.controller == NO_CONTROLLER).any():
        note += ", closed loop: it sees every state, the others only the first one"
    proof = verified.get(submission.digest)
    if proof:
        repeated = count_of(proof["evaluations"], "evaluation")
        note += f", {repeated} repeated by {proof['by']} on {proof['on']}"
    return SubmittedRow(
        results,
        rows,
        success_of(results, rows),
        submission.label,
        "verified" if proof else "submitted",
        f"{note}.",
    )


def _verified(path: Path) -> dict[str, dict[str, Any]]:
    """Returns who verified which file, by its SHA-256.

    Raises:
        InputError: the list cannot be read, or an entry lacks ``by``, ``on`` or ``evaluations``.
    """
    try:
        found = tomllib.loads(path.read_text()) if path.exists() else {}
    except (OSError, ValueError) as error:
        raise InputError(f"{path.name} cannot be read: {error}") from error
    for digest, entry in found.items():
        if not (isinstance(entry, dict) and {"by", "on", "evaluations"} <= {*entry}):
            raise InputError(f"{path.name}: {digest} must have by, on and evaluations")
        if type(entry["evaluations"]) is not int:
            raise InputError(f"{path.name}: evaluations of {digest} must be a whole number")
    return found
