"""Whether each claim of the paper holds, in the paper's own tables and in results of this suite.

In the paper's tables, a claim holds if all its statements hold for the printed numbers. In results,
a claim is

- reproduced, contradicted, underpowered or undecided: see `reports.multiple.verdict`;
- not run, if results are missing;
- failed, if results cannot be read.
"""

from operator import attrgetter
from typing import NamedTuple

import pandas as pd

from reports.claim import Claim
from reports.claims import CLAIMS
from reports.measured import Measured, NotRunError, measure
from reports.multiple import sides, verdict
from reports.printed import judge_paper
from reports.results import Results
from reports.seed_statistics import ALIKE, OVER_SEEDS
from tasks.errors import described
from tasks.words import count_of

FAILED, NOT_RUN = "failed", "not run"


class Judgement(NamedTuple):
    """The verdict on a claim in results of this suite."""

    ours: str
    """Reproduced, contradicted, underpowered, undecided, not run, or failed."""
    evidence: str
    """The number that decides, or comes nearest to deciding; else why there is no verdict."""


def verdicts(results: Results) -> pd.DataFrame:
    """Returns one row for each claim.

    Columns: ``claim`` its name, ``says``, ``source``, ``paper`` whether it holds in the paper's
    tables, ``ours`` and ``evidence``, see `Judgement`.
    """
    rows = [
        (claim.name, claim.says, claim.source, judge_paper(claim), *_attempt(claim, results))
        for claim in CLAIMS
    ]
    return pd.DataFrame(rows, columns=["claim", "says", "source", "paper", *Judgement._fields])


def _attempt(claim: Claim, results: Results) -> Judgement:
    """Returns the judgement, or the error that prevents it."""
    try:
        return judge(claim, results)
    except NotRunError as error:
        return Judgement(NOT_RUN, str(error))
    except Exception as error:
        return Judgement(FAILED, described(error))


def judge(claim: Claim, results: Results) -> Judgement:
    """Returns the verdict on a claim.

    Raises:
        reports.measured.NotRunError: results lack what the claim is about.
    """
    measured = [measure(statement, results) for statement in claim.statements]
    found = [one.found for one in measured]
    against, still_open = sides(found)
    deciding = against or still_open or found
    shown = min((one for one in measured if one.found in deciding), key=attrgetter("above_margin"))
    on_side = len(measured) - len(still_open)
    return Judgement(
        verdict(found, claim.relevant),
        f"{on_side} of {count_of(len(measured), 'comparison')} on the claimed side,"
        f" {len(against)} on the other; {shown}{_reach(measured)}",
    )


def _reach(measured: list[Measured]) -> str:
    """What the numbers speak of, if that is less than all seeds."""
    bases = {one.found.basis for one in measured} - {OVER_SEEDS, ALIKE}
    return f" (one seed: {', '.join(sorted(bases))})" if bases else ""
