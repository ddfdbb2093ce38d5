"""The claims of the paper, by appendix. `reports.verdicts` judges them.

Of each sentence that numbers can decide, the wording decides what is compared:

- "A outperforms B" in several conditions, and "all": every condition counts;
- "overall": one mean over all conditions;
- "a few": two conditions or more;
- "tends to": a rank correlation;
- "comparable", "roughly the same": under five points of success apart.
"""

from reports.claim import Claim
from reports.claims import observables, out_of_distribution, robustness, stability, training

CLAIMS: tuple[Claim, ...] = (
    *training.CLAIMS,
    *out_of_distribution.CLAIMS,
    *robustness.CLAIMS,
    *observables.CLAIMS,
    *stability.CLAIMS,
)
