"""Several comparisons at once: adjusted p-values, letters for a table, the verdict on a claim."""

from collections.abc import Sequence
from itertools import combinations
from string import ascii_letters
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from reports.seed_statistics import Estimate
from tasks.data import FloatArray, real
from tasks.errors import InputError

LEVEL = 0.05
"""Probability of one or more false findings among comparisons that are adjusted together."""


def holm(p_values: ArrayLike) -> FloatArray:
    """Returns p-values adjusted for their number (Holm 1979), in the order given.

    Args:
        p_values: (M,) of the comparisons that are made together.

    Raises:
        InputError: they are not (M,) numbers from 0 to 1.
    """
    p = real("p-values", p_values)
    if p.ndim != 1 or not ((p >= 0) & (p <= 1)).all():
        raise InputError(f"p-values must be (M,) numbers from 0 to 1, got {p.tolist()}")
    order = np.argsort(p)
    adjusted = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    return np.minimum(adjusted, 1)[np.argsort(order)]


def compact_letters(rates: ArrayLike, p_values: ArrayLike) -> list[str]:
    """Returns the letters of each method: two share one if, and only if, p is above 0.05.

    Methods that share a letter cannot be told apart. The letters go from the highest rate to the
    lowest. They are found by insert and absorb (Piepho 2004): at first one letter holds all;
    each pair that differs splits every letter that holds both, and letters within others go.

    Args:
        rates: (M,) of the methods.
        p_values: (M, M) adjusted p-value of each pair, symmetric; the diagonal is not read.

    Raises:
        InputError: the shapes disagree, p-values are not symmetric numbers from 0 to 1, or more
            than 52 letters would be needed.
    """
    heights, p = real("rates", rates), real("p-values", p_values)
    if heights.ndim != 1 or p.shape != 2 * heights.shape:
        raise InputError(
            f"letters need rates (M,) and p-values (M, M), got {heights.shape} and {p.shape}"
        )
    above = p[np.triu_indices_from(p, 1)]
    if not ((above >= 0) & (above <= 1) & (above == p.T[np.triu_indices_from(p, 1)])).all():
        raise InputError("p-values of pairs must be symmetric numbers from 0 to 1")
    order = np.argsort(-heights, kind="stable")
    places = p[np.ix_(order, order)]
    groups = _groups_without(
        [(a, b) for a, b in combinations(range(len(p)), 2) if places[a, b] <= LEVEL], len(p)
    )
    if len(groups) > len(ascii_letters):
        raise InputError(f"{len(p)} methods would need {len(groups)} letters, more than 52")
    letters = [""] * len(p)
    for letter, group in zip(ascii_letters, sorted(map(sorted, groups)), strict=False):
        for place in group:
            letters[order[place]] += letter
    return letters


def _groups_without(pairs: Sequence[tuple[int, int]], members: int) -> list[set[int]]:
    """The largest groups of members that hold none of the pairs."""
    groups = [set(range(members))]
    for one, other in pairs:
        split = [
            part
            for group in groups
            for part in ([group - {one}, group - {other}] if {one, other} <= group else [group])
        ]
        groups = []
        for part in sorted(split, key=len, reverse=True):
            if not any(part <= group for group in groups):
                groups.append(part)
    return groups


class Sides(NamedTuple):
    """Contrasts of a claim, by where they are found."""

    against: list[Estimate]
    """Below their margins, with a p-value of at most 0.05 after Holm's correction."""
    still_open: list[Estimate]
    """Not above their margins for sure, these included."""


def sides(contrasts: Sequence[Estimate]) -> Sides:
    """Returns which contrasts are against the claim that each is above its margin, or open."""
    adjusted = holm([one.p for one in contrasts])
    against = [
        one
        for one, p in zip(contrasts, adjusted, strict=True)
        if p <= LEVEL and one.value < one.margin
    ]
    return Sides(against, [one for one in contrasts if one.low <= one.margin])


def verdict(contrasts: Sequence[Estimate], relevant: float) -> str:
    """Returns what is found of a claim that each contrast is above its margin.

    - ``contradicted``: some contrast is below its margin, with a p-value of at most 0.05 after
      Holm's correction for the number of contrasts;
    - ``reproduced``: the intervals of all contrasts lie above their margins. No correction is
      needed, since one that does not is enough to prevent it;
    - ``underpowered``: neither, and the interval of some contrast that is open is wider than the
      relevant difference, so that more seeds may decide;
    - ``undecided``: neither, with intervals as narrow as that.

    A contrast that equals its margin never contradicts.

    Args:
        contrasts: of one claim, each tested against its own margin.
        relevant: the smallest difference that matters, in the unit of the contrasts.

    Raises:
        InputError: there are no contrasts.
    """
    if not contrasts:
        raise InputError("a verdict needs at least one contrast")
    against, still_open = sides(contrasts)
    if against:
        return "contradicted"
    if not still_open:
        return "reproduced"
    wide = any(one.high - one.low > relevant for one in still_open)
    return "underpowered" if wide else "undecided"
