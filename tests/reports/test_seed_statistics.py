from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.special import expit, logit
from scipy.stats import norm, spearmanr, t, ttest_rel
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.proportion import proportion_confint

from reports.multiple import compact_letters, holm, verdict
from reports.seed_statistics import (
    ALIKE,
    ONE_SEED,
    OVER_SEEDS,
    aggregate,
    difference,
    rank_correlation,
    rate,
)
from tasks.data import generator
from tasks.errors import InputError


def episodes(*percents, starts=1000):
    """Episodes (R, N) of seeds that succeed from their first starts, so many in a hundred."""
    return np.arange(starts) < starts * np.array(percents)[:, None] / 100


@pytest.fixture
def three():
    """Three methods and five seeds, worked by hand below."""
    a, b, c = (55, 57, 53, 59, 56), (50, 59, 49, 58, 54), (40, 38, 41, 37, 39)
    return [episodes(*percents) for percents in (a, b, c)]


def test_a_study_of_three_methods_and_five_seeds_is_as_worked_by_hand(three):
    a, b, c = three
    # Means 56, 54 and 39. a - b: 5, -2, 4, 1, 2, so mean 2, squared deviations 9 + 16 + 4 + 1 + 0,
    # standard error sqrt(30 / 4 / 5) = 1.2247, t = 1.633, 95% at 2.776 standard errors: -1.4, 5.4.
    first = difference(a, b)
    assert first[:3] == pytest.approx((0.02, -0.0140, 0.0540), abs=5e-4)
    assert first.p == pytest.approx(0.178, abs=1e-3)
    # a - c: 15, 19, 12, 22, 17: mean 17, squared 4 + 4 + 25 + 25 + 0, error 1.703, t = 9.98.
    second = difference(a, c)
    assert second[:3] == pytest.approx((0.17, 0.1227, 0.2173), abs=5e-4)
    # b - c: 10, 21, 8, 21, 15: mean 15, squared 25 + 36 + 49 + 36 + 0, error 2.702, t = 5.552.
    third = difference(b, c)
    assert third[:3] == pytest.approx((0.15, 0.0750, 0.2250), abs=5e-4)
    # Holm: the smallest of three times 3, the next times 2, the last as it is.
    adjusted = holm([first.p, second.p, third.p])
    assert adjusted == pytest.approx([0.178, 0.0018, 0.0104], abs=2e-4)
    matrix = np.ones((3, 3))
    for (i, j), p in zip([(0, 1), (0, 2), (1, 2)], adjusted, strict=True):
        matrix[i, j] = matrix[j, i] = p
    assert compact_letters([rate(one).value for one in three], matrix) == ["a", "a", "b"]
    assert verdict([second, third], 0.05) == "reproduced"
    assert verdict([first, second], 0.05) == "underpowered"
    assert verdict([difference(c, a), difference(c, b)], 0.05) == "contradicted"


def test_the_rate_of_seeds_is_their_mean_with_students_t_on_the_logit_scale():
    found = rate(episodes(88, 92, 97, 79, 94))
    rates = np.array([0.88, 0.92, 0.97, 0.79, 0.94])
    mean, error = rates.mean(), rates.std(ddof=1) / np.sqrt(5)
    away = t.ppf(0.975, 4) * error / (mean * (1 - mean))
    ends = expit(logit(mean) - away), expit(logit(mean) + away)
    assert found[:3] == pytest.approx((mean, *ends))
    assert (found.seeds, found.basis) == (5, OVER_SEEDS)


@pytest.mark.parametrize(
    ("outcomes", "basis"),
    [(episodes(93), ONE_SEED), (episodes(100, 100, 100), ALIKE), (episodes(0, 0), ALIKE)],
)
def test_without_seeds_that_differ_the_rate_has_wilsons_interval_and_says_so(outcomes, basis):
    found = rate(outcomes)
    wilson = proportion_confint(outcomes.sum(), outcomes.size, method="wilson")
    assert found[1:3] == pytest.approx(wilson, abs=1e-12)
    assert found.basis == basis


def test_seeds_that_agree_by_chance_do_not_narrow_an_interval_below_that_of_their_episodes():
    alike = episodes(98, 98, 98, starts=200)
    wilson = proportion_confint(alike.sum(), alike.size, method="wilson")
    assert rate(alike)[1:3] == pytest.approx(wilson)
    better = difference(episodes(99, 99, 99, starts=200), alike)
    # Six of 600 starts tell the methods apart; half a start is added to each kind of outcome.
    error = np.sqrt((7 / 602 - (6 / 602) ** 2) / 602)
    assert better.p == pytest.approx(2 * norm.sf(6 / 602 / error))
    assert better.high - better.low == pytest.approx(2 * 1.96 * error, rel=1e-4)


def test_a_difference_is_that_of_the_paired_t_test_where_rates_are_far_from_0_and_100():
    left, right = episodes(55, 57, 53, 59, 56), episodes(46, 44, 47, 42, 49)
    found = difference(left, right)
    oracle = ttest_rel(left.mean(axis=1), right.mean(axis=1))
    assert found[1:3] == pytest.approx(tuple(oracle.confidence_interval(0.95)), abs=1e-3)
    assert found.p == pytest.approx(oracle.pvalue, rel=0.05)
    assert found.p >= oracle.pvalue


def test_a_difference_near_100_is_wider_on_the_side_where_rates_may_be_lower():
    """One seed in three fell: what the t-test cannot see is that another may fall as far."""
    left, right = episodes(99, 98.5, 82), episodes(99, 98.9, 98.6)
    found, plain = difference(left, right), ttest_rel(left.mean(axis=1), right.mean(axis=1))
    interval = plain.confidence_interval(0.95)
    assert found.low < interval.low - 0.1
    assert found.high == pytest.approx(interval.high)


def test_one_seed_of_each_is_compared_by_mcnemars_exact_test_and_says_so():
    rng = generator("mcnemar")
    left, right = rng.random((2, 1, 300)) < np.array([0.8, 0.7])[:, None, None]
    found = difference(left, right)
    table = [[(left & right).sum(), (left & ~right).sum()], [(~left & right).sum(), 0]]
    assert found.p == pytest.approx(mcnemar(table, exact=True).pvalue)
    assert found.low < left.mean() - right.mean() < found.high
    assert found.basis == ONE_SEED


def test_methods_that_always_succeed_cannot_be_told_apart_and_differ_by_little():
    found = difference(episodes(100, 100, 100), episodes(100, 100, 100))
    assert (found.value, found.p, found.basis) == (0, 1, ALIKE)
    assert -0.002 < found.low < 0 < found.high < 0.002


SEEDS = arrays(bool, (2, 4, 30))


@given(SEEDS, st.sampled_from([-0.05, 0.0, 0.1]))
def test_swapping_the_methods_mirrors_the_difference(both, margin):
    one, other = difference(*both, margin), difference(*both[::-1], -margin)
    assert one.value == pytest.approx(-other.value)
    assert (one.low, one.high) == pytest.approx((-other.high, -other.low), abs=1e-9)
    assert one.p == pytest.approx(other.p, abs=1e-9)


@given(SEEDS)
def test_intervals_hold_their_value_and_stay_within_what_is_possible(both):
    found = rate(both[0])
    assert 0 <= found.low <= found.value <= found.high <= 1
    found = difference(*both)
    assert -1 <= found.low <= found.value <= found.high <= 1
    assert 0 <= found.p <= 1


def test_seeds_whose_differences_cancel_have_a_p_value_of_1():
    found = difference(episodes(10, 20, 30, 70), episodes(30, 10, 20, 70))
    assert found.value == pytest.approx(0, abs=1e-15)
    assert found.p == pytest.approx(1)


@pytest.mark.parametrize("gap", [0.5, 1, 2, 4, 8])
def test_the_p_value_says_whether_the_margin_lies_in_the_interval(gap):
    right = episodes(70, 74, 66, 71, 69)
    found = difference(right, right)
    left = episodes(70 + gap, 74 + 2 * gap, 66 + gap, 71 + gap, 69)
    for margin in (-0.01, 0.0, 0.02):
        found = difference(left, right, margin)
        assert (found.p <= 0.05) == (not found.low <= margin <= found.high)


def test_an_aggregate_is_one_mean_difference_a_seed():
    left = [episodes(60, 50, 40), episodes(45, 55, 50)]
    right = [episodes(50, 45, 45), episodes(45, 46, 50)]
    found = aggregate(list(zip(left, right, strict=True)))
    # Conditions differ by 10, 5, -5 and 0, 9, 0: means 5, 7 and -2.5.
    oracle = ttest_rel([5, 7, -2.5], [0, 0, 0])
    assert found.value == pytest.approx(0.095 / 3)
    assert found.p == pytest.approx(oracle.pvalue, rel=0.01)
    assert found.seeds == 3


def test_a_rank_correlation_is_the_mean_of_spearmans_over_seeds_and_panels():
    rng = generator("rank correlation")
    levels = np.array([10, 40, 20, 30, 50])
    values = levels / 50 + 1.5 * rng.standard_normal((4, 2, 5))
    found = rank_correlation(levels, values)
    by_seed = [np.mean([spearmanr(levels, panel).statistic for panel in seed]) for seed in values]
    half = t.ppf(0.975, 3) * np.std(by_seed, ddof=1) / 2
    assert half > 1.96 / np.sqrt(4 * 2 * 4)
    assert found.value == pytest.approx(np.mean(by_seed))
    assert found.low == pytest.approx(np.mean(by_seed) - half)
    assert found.high == pytest.approx(min(1, np.mean(by_seed) + half))


def test_a_rank_correlation_has_the_p_value_of_all_orders_of_the_levels():
    values = np.array([[1.0, 2, 4, 3], [2, 1, 3, 4]])
    orders = np.array([*permutations([1, 2, 3, 4])]) @ np.arange(4)
    sums = orders[:, None] + orders
    as_far = (sums >= (values @ np.arange(4)).sum()).mean()
    assert rank_correlation(range(4), values[:, None]).p == pytest.approx(2 * as_far)


def test_seeds_that_agree_on_a_weak_order_do_not_show_a_trend():
    found = rank_correlation(range(4), [[[1, 0, 3, 2]]] * 3)
    assert found.low < 0 < found.value < found.high
    assert found.p > 0.05


def test_a_single_seed_says_that_it_speaks_of_itself():
    found = rank_correlation(range(5), [[[1, 2, 3, 4, 5]]])
    assert (found.value, found.high) == pytest.approx((1, 1))
    assert found.low == pytest.approx(1 - 1.96 / 2, abs=1e-3)
    assert (found.p, found.basis) == (1, ONE_SEED)


def test_values_that_fall_with_the_levels_have_a_negative_correlation():
    found = rank_correlation([1, 2, 3, 4], -np.arange(4.0) * np.ones((5, 1, 1)))
    assert (found.value, found.low) == pytest.approx((-1, -1))
    assert found.high < 0
    assert found.p < 0.001


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: rate(np.zeros((0, 5))), "outcomes need the axes"),
        (lambda: rate([[0.5, 2.0]]), "numbers from 0 to 1"),
        (lambda: rate([True, False]), r"got shape \(2,\)"),
        (lambda: difference(episodes(50, 50), episodes(50)), "same seeds and starts"),
        (lambda: aggregate([]), "of no condition"),
        (lambda: aggregate([(episodes(1), episodes(1, 2))]), "same seeds and number of starts"),
        (lambda: rank_correlation([1, 2, 3], np.full((2, 1, 3), np.nan)), "finite values"),
        (lambda: rank_correlation([1, 1, 2], np.ones((2, 1, 3))), "3 or more different levels"),
    ],
)
def test_arrays_that_cannot_be_compared_are_named(call, says):
    with pytest.raises(InputError, match=says):
        call()
