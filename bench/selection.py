"""Model selection: the size of a method that all experiments but `sizes` use."""

from collections.abc import Sequence

import pandas as pd


def best_size(evaluations: pd.DataFrame, sizes: Sequence[str]) -> str:
    """Returns the size of the highest mean success over seeds; ties go to the earlier (Tables 2-5).

    Args:
        evaluations: of one task and method from validation starts, with the columns ``size``,
            ``successes`` and ``episodes``.
        sizes: that there is a choice of; one without evaluations comes last.
    """
    rates = evaluations.successes / evaluations.episodes
    # Means of the same rates in another order differ in their last digit.
    means = rates.groupby(evaluations["size"]).mean().round(9)
    return max(sizes, key=lambda size: float(means.get(size, -1.0)))
