"""Claims of appendix H: success out of distribution."""

from bench.labels import EXPERT
from reports.claim import (
    BASELINES,
    LEARNERS,
    SIMILAR,
    AtLeast,
    Claim,
    Contrast,
    Setting,
    about_the_same,
)
from tasks.registry import TASKS


def _ood(method: str, task: str) -> Setting:
    return Setting(method, task, split="ood")


OTHER_TASKS = TASKS[1:]
CLAIMS = (
    Claim(
        "expert-ood",
        "Out of distribution, no method outperforms the expert on most tasks: on two or more of the"
        " four, the expert succeeds more often.",
        "appendix H",
        tuple(
            AtLeast(2, tuple(Contrast(_ood(EXPERT, task), _ood(m, task)) for task in TASKS))
            for m in LEARNERS
        ),
    ),
    Claim(
        "kodex-ood-tool",
        "Out of distribution, KODex outperforms the four baselines on Tool.",
        "appendix H",
        tuple(Contrast(_ood("kodex", "tool"), _ood(m, "tool")) for m in BASELINES),
    ),
    Claim(
        "ngf-ood",
        "Out of distribution, NGF performs best of the methods on each of the other tasks.",
        "appendix H",
        tuple(
            Contrast(_ood("ngf", task), _ood(m, task))
            for task in OTHER_TASKS
            for m in LEARNERS
            if m != "ngf"
        ),
    ),
    Claim(
        "kodex-ood-comparable",
        "Out of distribution, KODex performs comparably to NDP and LSTM on each of the other tasks"
        f" (within {SIMILAR:g} points).",
        "appendix H",
        tuple(
            contrast
            for task in OTHER_TASKS
            for m in ("ndp", "lstm")
            for contrast in about_the_same(_ood("kodex", task), _ood(m, task))
        ),
    ),
)
