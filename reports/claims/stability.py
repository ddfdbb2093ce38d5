"""Claims of appendix K: the eigenvalues of K."""

from reports.claim import Claim, LargestAboveOne, MostBelowOne
from tasks.registry import TASKS

CLAIMS = (
    Claim(
        "most-magnitudes-below-one",
        "On each task, most eigenvalue magnitudes of K are less than one.",
        "appendix K",
        tuple(map(MostBelowOne, TASKS)),
    ),
    Claim(
        "some-magnitudes-above-one",
        "On each task, a few eigenvalue magnitudes of K are larger than one (the largest is).",
        "appendix K",
        tuple(map(LargestAboveOne, TASKS)),
        relevant=0.001,
    ),
)
