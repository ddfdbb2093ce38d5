from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from statsmodels.stats.multitest import multipletests

from reports.multiple import compact_letters, holm, verdict
from reports.seed_statistics import OVER_SEEDS, Estimate
from tasks.errors import InputError

P_VALUES = st.floats(0, 1, allow_subnormal=False)


@settings(max_examples=10)  # each takes statsmodels a tenth of a second
@given(st.lists(P_VALUES, min_size=1, max_size=20))
def test_holm_is_that_of_statsmodels(p_values):
    assert holm(p_values) == pytest.approx(multipletests(p_values, method="holm")[1], abs=1e-12)


def test_p_values_that_are_none_are_refused():
    with pytest.raises(InputError, match="numbers from 0 to 1"):
        holm([0.5, np.nan])


@st.composite
def studies(draw):
    """Rates of methods, and which pairs differ significantly."""
    methods = draw(st.integers(1, 8))
    rates = draw(st.lists(st.floats(0, 1), min_size=methods, max_size=methods))
    differs = np.zeros((methods, methods), bool)
    for one, other in combinations(range(methods), 2):
        differs[one, other] = differs[other, one] = draw(st.booleans())
    return rates, differs


@given(studies())
def test_two_methods_share_a_letter_exactly_if_they_cannot_be_told_apart(study):
    rates, differs = study
    letters = compact_letters(rates, np.where(differs, 0.01, 0.2))
    for one, other in combinations(range(len(rates)), 2):
        assert bool(set(letters[one]) & set(letters[other])) != differs[one, other]
    assert all(letters)


@given(studies())
def test_letters_stand_for_the_largest_groups_and_start_with_the_best_method(study):
    rates, differs = study
    letters = compact_letters(rates, np.where(differs, 0.01, 0.2))
    methods = range(len(rates))
    alike = [
        set(group)
        for size in range(1, len(rates) + 1)
        for group in combinations(methods, size)
        if not differs[np.ix_(group, group)].any()
    ]
    largest = [one for one in alike if not any(one < other for other in alike)]
    groups = {letter: {m for m in methods if letter in letters[m]} for letter in "".join(letters)}
    assert sorted(map(sorted, groups.values())) == sorted(map(sorted, largest))
    best = [max(rates[m] for m in groups[letter]) for letter in sorted(groups)]
    assert best == sorted(best, reverse=True)


def test_a_matrix_that_is_not_symmetric_is_refused():
    with pytest.raises(InputError, match="symmetric"):
        compact_letters([0.5, 0.6], [[1, 0.2], [0.3, 1]])
    with pytest.raises(InputError, match="rates"):
        compact_letters([0.5], [[1, 0.2], [0.2, 1]])


def contrast(value, half, p, margin=0.0):
    return Estimate(value, value - half, value + half, p, margin, 5, OVER_SEEDS)


@pytest.mark.parametrize(
    ("contrasts", "found"),
    [
        ([contrast(0.1, 0.05, 0.001), contrast(0.06, 0.05, 0.03)], "reproduced"),
        ([contrast(0.1, 0.05, 0.001), contrast(-0.1, 0.05, 0.001)], "contradicted"),
        ([contrast(0.0, 0.0, 1.0)], "undecided"),
        ([contrast(0.1, 0.05, 0.001), contrast(0.01, 0.02, 0.3)], "undecided"),
        ([contrast(0.1, 0.05, 0.001), contrast(0.01, 0.04, 0.6)], "underpowered"),
        ([contrast(-0.02, 0.02, 0.6, margin=-0.05)], "reproduced"),
        ([contrast(-0.07, 0.01, 0.01, margin=-0.05)], "contradicted"),
    ],
)
def test_verdicts_on_a_claim(contrasts, found):
    assert verdict(contrasts, 0.05) == found


def test_one_of_many_contrasts_contradicts_only_after_correction():
    against, others = contrast(-0.1, 0.08, 0.02), [contrast(0.1, 0.05, 0.001)] * 5
    assert verdict([against], 0.05) == "contradicted"
    assert verdict([against, *others], 0.2) == "contradicted"
    level = [contrast(0.0, 0.05, 1.0)] * 5
    assert verdict([against, *level], 0.2) == "undecided"


def test_a_verdict_needs_contrasts():
    with pytest.raises(InputError, match="at least one"):
        verdict([], 0.05)
