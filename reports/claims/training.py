"""Claims of appendix F and of the abstract: what training takes."""

from reports.claim import BASELINES, SIMILAR, Claim, SeedMatters, SizeMatters, TrainsLonger
from tasks.registry import TASKS

MUCH_LONGER = 3.0
"""Times as long as KODex. On a log scale, nearer to an order of magnitude than to 1 is 3.2."""
CLAIMS = (
    Claim(
        "kodex-trains-faster",
        "KODex trains about an order of magnitude faster than each baseline, on each task (in under"
        " a third of the time).",
        "abstract",
        tuple(TrainsLonger(m, task, MUCH_LONGER) for m in BASELINES for task in TASKS),
        relevant=1.0,
        unprinted="no numbers in the appendix",
    ),
    Claim(
        "baselines-need-tuned-size",
        "Unlike KODex, the baselines need their size tuned: the best size of each succeeds more"
        f" often than the worst by over {SIMILAR:g} points (from validation starts, mean over"
        " tasks; best and worst as chosen by the other seeds).",
        "appendix F",
        tuple(SizeMatters(m) for m in BASELINES),
    ),
    Claim(
        "baselines-vary-by-seed",
        "The baselines are sensitive to their initial parameters: the success of each varies more"
        " over seeds than that of KODex, which draws none (standard deviation from unseen starts,"
        " mean over tasks).",
        "appendix F",
        tuple(SeedMatters(m) for m in BASELINES),
    ),
)
