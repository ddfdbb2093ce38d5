"""Claims of appendix J: the choice of observables."""

from itertools import combinations

from reports.claim import (
    ERROR,
    SIMILAR,
    SUCCESS,
    TIME,
    Claim,
    Contrast,
    Setting,
    Trend,
    about_the_same,
)
from tasks.registry import TASKS

CORRELATION = 0.5
"""The width of an interval above which a correlation is open."""


def _set(variant: str, task: str) -> Setting:
    return Setting("kodex", task, variant=variant)


SET_2, SET_3, SET_4 = "set_2", "described", "set_4"
CLAIMS = (
    Claim(
        "time-grows",
        "KODex's training time increases with the number of observables (rank correlation over the"
        " four sets, mean over tasks).",
        "appendix J",
        (Trend(TIME, rises=True),),
        relevant=CORRELATION,
    ),
    Claim(
        "error-falls",
        "Increasing the number of observables tends to decrease the imitation error (rank"
        " correlation over the four sets, mean over tasks).",
        "appendix J",
        (Trend(ERROR, rises=False),),
        relevant=CORRELATION,
    ),
    Claim(
        "success-rises",
        "Increasing the number of observables tends to increase success (rank correlation over the"
        " four sets, mean over tasks).",
        "appendix J",
        (Trend(SUCCESS, rises=True),),
        relevant=CORRELATION,
    ),
    Claim(
        "sets-alike",
        "KODex's success on each task is roughly the same with sets 2, 3 and 4 of observables"
        f" (within {SIMILAR:g} points).",
        "appendix J",
        tuple(
            contrast
            for task in TASKS
            for one, other in combinations((SET_2, SET_3, SET_4), 2)
            for contrast in about_the_same(_set(one, task), _set(other, task))
        ),
    ),
    Claim(
        "set-2-relocation",
        "On Relocation, KODex does marginally better with set 2 than with set 3 (by under"
        f" {SIMILAR:g} points).",
        "appendix J",
        (
            Contrast(_set(SET_2, "relocation"), _set(SET_3, "relocation")),
            Contrast(_set(SET_3, "relocation"), _set(SET_2, "relocation"), -SIMILAR),
        ),
    ),
)
