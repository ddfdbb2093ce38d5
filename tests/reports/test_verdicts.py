"""Verdicts on claims, for small studies that are worked by hand."""

import numpy as np
import pandas as pd
import pytest

from reports import verdicts as module
from reports.at_least import corrections, kth_largest
from reports.claim import (
    ERROR,
    SUCCESS,
    TIME,
    AtLeast,
    Claim,
    Contrast,
    LargestAboveOne,
    MostBelowOne,
    Overall,
    SeedMatters,
    Setting,
    SizeMatters,
    TrainsLonger,
    Trend,
)
from reports.exhibits.table_11 import SETS
from reports.measured import measure
from reports.results import Results
from reports.seed_statistics import ONE_SEED, OVER_SEEDS, Estimate, difference
from reports.simulated import Scenario, repeated
from reports.verdicts import judge, verdicts
from tasks.data import generator
from tasks.registry import TASKS

STARTS = 1000
METHODS = ("kodex", "nn", "lstm", "ndp", "ngf")
KODEX, NN = Setting("kodex", "tool"), Setting("nn", "tool")


def episodes(percents, starts=STARTS):
    """Success (R, N) of seeds that succeed from their first starts, so many in a hundred."""
    return np.arange(starts) < starts * np.array(percents)[:, None] / 100


class Seeds(Results):
    """Results whose success in each setting is given as each seed's share [%]."""

    frame = pd.DataFrame()
    rows = episodes = property(lambda self: self)

    def __init__(self, percents):
        """Takes a function from the values of a selection to each seed's share, or None."""
        self.percents = percents

    def select(self, **values):
        return pd.DataFrame([] if self.percents(values) is None else [values])

    main = select

    def at_one_size(self, parts):
        return parts

    def of_selections(self, selections):
        found = [rows.to_dict("records") for rows in selections]
        return [episodes(self.percents(one[0])) if one else None for one in found]


def of(**percents):
    """Results on Tool, and on every other task alike, by name of the method."""
    return Seeds(lambda values: percents.get(values["method"]))


def claim(*statements, relevant=5.0):
    return Claim("name", "A sentence.", "appendix X", statements, relevant)


A, B, C = (55, 57, 53, 59, 56), (50, 59, 49, 58, 54), (40, 38, 41, 37, 39)


@pytest.mark.parametrize(
    ("kodex", "nn", "verdict", "evidence"),
    [
        # Worked by hand in test_seed_statistics.py.
        (A, C, "reproduced", "1 of 1 comparison on the claimed side, 0 on the other"),
        (C, A, "contradicted", "0 of 1 comparison on the claimed side, 1 on the other"),
        (A, B, "underpowered", "KODex Tool minus NN Tool: +2.0 points [-1.4, 5.4], claimed above"),
        # Differences 1, -1, 0, 1, 0: mean 0.2, error sqrt(2.8 / 4 / 5) = 0.374, times 2.776 is 1.0.
        ((56, 54, 55, 56, 55), (55,) * 5, "undecided", "+0.2 points [-0.8, 1.2], claimed above 0"),
    ],
)
def test_verdict_on_a_contrast_is_as_worked_by_hand(kodex, nn, verdict, evidence):
    found = judge(claim(Contrast(KODEX, NN)), of(kodex=kodex, nn=nn))
    assert found.ours == verdict
    assert evidence in found.evidence


@pytest.mark.parametrize(
    ("left", "right", "margin"),
    [((50,) * 5, (55,) * 5, -5.0), ((100,) * 3, (100,) * 3, 0.0), ((70,), (70,), 0.0)],
)
def test_a_tie_at_the_margin_never_contradicts(left, right, margin):
    tie, clear = Contrast(KODEX, NN, margin), Contrast(NN, Setting("lstm", "tool"))
    found = judge(claim(*[tie] * 12, clear), of(kodex=left, nn=right, lstm=np.zeros(len(left))))
    assert found.ours in ("undecided", "underpowered")
    assert found.evidence.startswith("1 of 13 comparisons on the claimed side, 0 on the other")


def test_a_contrast_contradicts_only_after_correction_for_their_number():
    # Differences -1, -2, -8, -9, -5: mean -5, error sqrt(50 / 4 / 5) = 1.58, t = -3.16, p = 0.034.
    against = of(kodex=(59, 58, 52, 51, 55), nn=(60,) * 5, lstm=(55, 57, 53, 56, 54), ndp=(55,) * 5)
    one, level = Contrast(KODEX, NN), Contrast(Setting("lstm", "tool"), Setting("ndp", "tool"))
    assert judge(claim(one), against).ours == "contradicted"
    assert judge(claim(one, level), against).ours == "underpowered"


def test_a_claim_is_reproduced_only_if_all_its_contrasts_are():
    results = of(kodex=A, nn=C, lstm=B)
    other = Contrast(KODEX, Setting("lstm", "tool"))
    assert judge(claim(Contrast(KODEX, NN), other), results).ours == "underpowered"


def test_evidence_of_one_seed_says_so():
    found = judge(claim(Contrast(KODEX, NN)), of(kodex=(60,), nn=(50,)))
    assert found.ours == "reproduced"
    assert found.evidence.endswith(f"claimed above 0 (one seed: {ONE_SEED})")


def test_overall_is_one_mean_over_its_conditions():
    rates = {"tool": {"kodex": (90, 92, 91), "nn": (60, 61, 62)}}
    rates["door"] = {"kodex": (50, 53, 50), "nn": (60, 60, 60)}
    results = Seeds(lambda values: rates[values["task"]][values["method"]])
    pairs = tuple((Setting("kodex", task), Setting("nn", task)) for task in ("tool", "door"))
    # Tool 30, 31, 29 and Door -10, -7, -10: by seed 10, 12, 9.5; mean 10.5, error 0.764. t reaches
    # 3.29 to each side, the logit form a little further down.
    found = judge(claim(Overall(pairs)), results)
    assert found.ours == "reproduced"
    assert "KODex minus NN, mean of 2 conditions: +10.5 points [7.1, 13.8]" in found.evidence
    assert judge(claim(*(Contrast(*pair) for pair in pairs)), results).ours == "contradicted"


def test_tasks_with_other_seeds_count_as_far_as_all_have_them():
    rates = {"tool": (90, 92, 91, 93), "door": (80, 81, 79)}
    results = Seeds(
        lambda values: np.array(rates[values["task"]]) - 20 * (values["method"] == "nn")
    )
    pairs = tuple((Setting("kodex", task), Setting("nn", task)) for task in rates)
    assert measure(Overall(pairs), results).found.seeds == 3


def few(*leads, count=2):
    """Results in which KODex leads by so much on each of these tasks, and a statement of them."""
    rates = dict(zip(TASKS, leads, strict=False))
    spread = np.array([-2, -1, 0, 1, 2])
    results = Seeds(
        lambda values: 50 + (rates[values["task"]] + spread) * (values["method"] == "kodex")
    )
    contrasts = tuple(Contrast(Setting("kodex", t), Setting("nn", t)) for t in rates)
    return claim(AtLeast(count, contrasts)), results


@pytest.mark.parametrize(
    ("leads", "verdict", "evidence"),
    [
        ((20, 15, -30, -40), "reproduced", "second largest of 4 differences, KODex Door minus"),
        ((20, -15, -30, -40), "contradicted", "KODex Door minus NN Door: -15.0 points"),
        ((20, 0, -30, -40), "undecided", "KODex Door minus NN Door: +0.0 points"),
        ((20, -15, 0, -40), "undecided", "KODex Relocation minus NN Relocation: +0.0 points"),
    ],
)
def test_a_few_conditions_are_two_or_more(leads, verdict, evidence):
    statement, results = few(*leads)
    found = judge(Claim("", "", "", statement.statements, relevant=10.0), results)
    assert found.ours == verdict
    assert evidence in found.evidence


def test_at_least_so_many_is_corrected_for_the_number_of_comparisons():
    each = [Estimate(v, v - 2, v + 3, p, 0.0, 5, OVER_SEEDS) for v, p in [(5, 0.01), (4, 0.02)]]
    level = [Estimate(0, -2, 3, 1.0, 0.0, 5, OVER_SEEDS)] * 2
    wider = [one._replace(high=one.high + 1) for one in (*each, *level)]
    # The second largest of four is above 0 if three comparisons fail, below 0 if two fail.
    assert corrections(4, 2) == (3, 2)
    assert kth_largest([*each, *level], wider, 2)[:4] == pytest.approx((4, 2, 8, 3 * 0.02))
    lowered = [one._replace(value=-one.value) for one in each]
    assert kth_largest([*lowered, *level], wider, 2).p == 1
    # All but one of the lowest three must be below 0: p is twice the largest of the smallest three.
    low = [*lowered, lowered[1], level[0]]
    assert kth_largest(low, low, 2).p == pytest.approx(2 * 0.02)


@pytest.mark.parametrize("place", [0, 1])
def test_at_least_so_many_speaks_of_the_fewest_seeds_wherever_they_stand(place):
    several = Estimate(5, 3, 8, 0.01, 0.0, 5, OVER_SEEDS)
    each = [several]
    each.insert(place, several._replace(seeds=1, basis=ONE_SEED))
    found = kth_largest(each, each, 1)
    assert (found.seeds, found.basis) == (1, ONE_SEED)


def second_largest(pairs):
    """Of differences of outcomes (R, N)."""
    return kth_largest(
        *([difference(*pair, 0, n) for pair in pairs] for n in corrections(len(pairs), 2)), 2
    )


def test_interval_and_p_value_of_at_least_so_many_agree():
    near_the_top = (episodes([99.6, 99.2, 100]), episodes([82.4] * 3))
    found = second_largest([near_the_top] * 16)
    assert (found.low > 0, found.p <= 0.05) == (False, False)
    rng, agreed = generator("interval and p-value"), []
    for _ in range(100):
        found = second_largest(
            [tuple(map(episodes, pair)) for pair in rng.uniform(60, 100, (4, 2, 3))]
        )
        agreed.append((found.low > 0 or found.high < 0) == (found.p <= 0.05))
        assert -1 <= found.low <= found.value <= found.high <= 1
    assert all(agreed)


def test_two_of_many_conditions_seldom_seem_better_by_chance():
    rng, seeds, starts = generator("a few"), 5, 100
    found = []
    for _ in range(60):
        skills = np.clip(rng.normal(0.8, 0.05, (32, 2, seeds, 1)), 0, 1)
        estimate = second_largest(rng.random((32, 2, seeds, starts)) < skills)
        found.append((estimate.low > 0, estimate.p <= 0.05 and estimate.value < 0))
    assert np.mean(found, axis=0).max() <= 0.05


def sizes(**percents):
    """Results in which each baseline has these sizes on every task."""
    return Seeds(lambda values: percents.get(values["size"]))


def test_what_a_wrong_size_costs_is_the_mean_gap_between_best_and_worst():
    results = sizes(small=(50, 52, 51), median=(80, 84, 85), large=(70, 70, 70))
    # 30, 32, 34: mean 32, error sqrt(8 / 2 / 3) = 1.155, times 4.303 = 4.97; the logit form reaches
    # a little further down.
    found = judge(claim(SizeMatters("nn", 5.0)), results)
    assert found.ours == "reproduced"
    assert "NN, best size minus worst size, mean over tasks: +32.0 points [26.3, 37.0]" in (
        found.evidence
    )


def test_sizes_that_are_best_by_luck_are_not_called_better():
    # In each seed the best is 20 points above the worst, and each size is best once.
    results = sizes(small=(60, 50, 40), median=(50, 40, 60), large=(40, 60, 50))
    found = measure(SizeMatters("nn", 5.0), results).found
    assert found.value <= 0


def test_best_size_of_one_seed_is_not_run():
    statement = claim(SizeMatters("nn"))
    for results in (sizes(small=(50,), large=(60,)), sizes(small=(50, 60))):
        with pytest.raises(module.NotRunError, match=r"one seed|no two sizes of NN on Tool"):
            judge(statement, results)


def spread(percents):
    """The standard deviation of rates [points], less what starts have of themselves."""
    rates = np.array(percents) / 100
    of_starts = np.mean([rate * (1 - rate) / (STARTS - 1) for rate in rates])
    return 100 * np.sqrt(max(np.var(rates, ddof=1) - of_starts, 0))


def test_spread_over_seeds_is_compared_with_that_of_kodex():
    kodex, nn = (80, 91, 92), (50, 60, 80)
    found = measure(SeedMatters("nn"), of(kodex=kodex, nn=nn)).found
    whole = spread(nn) - spread(kodex)
    without = [spread(np.delete(nn, i)) - spread(np.delete(kodex, i)) for i in range(3)]
    jackknifed = 3 * whole - 2 * np.array(without)
    half = 4.303 * jackknifed.std(ddof=1) / np.sqrt(3)
    assert found[:3] == pytest.approx(
        (jackknifed.mean(), jackknifed.mean() - half, jackknifed.mean() + half), abs=1e-2
    )
    with pytest.raises(module.NotRunError, match="takes 3 seeds, there are 2"):
        measure(SeedMatters("nn"), of(kodex=(90, 91), nn=(50, 60)))


def test_a_method_at_half_does_not_vary_more_with_the_seed_than_one_near_all():
    """Seeds that differ by nothing but the luck of their starts."""
    rng = generator("luck of starts")
    rates = {"nn": 0.5, "kodex": 0.97}
    drawn = {name: 100 * rng.binomial(STARTS, p, 10) / STARTS for name, p in rates.items()}
    assert spread(drawn["nn"]) < np.std(drawn["nn"], ddof=1)
    assert judge(claim(SeedMatters("nn")), of(**drawn)).ours != "reproduced"


class Kodex(Seeds):
    """Results of fits of KODex: errors, magnitudes and times by seed and set."""

    def __init__(self, seeds=3, error=lambda level, seed: 1 / level, magnitudes=(0.5, 1.1)):
        self.error, self.given = error, magnitudes
        super().__init__(
            lambda values: 50 + 10 * list(SETS).index(values["variant"]) + np.arange(seeds)
        )
        self.frame = pd.DataFrame(
            {"task": task, "method": method, "variant": variant, "seed": seed}
            | {
                "folder": f"{level}/{seed}",
                "config": {},
                "fit_seconds": level if seed == 1 else np.nan,
            }
            for task in TASKS
            for method in METHODS
            for level, variant in enumerate(SETS, 1)
            for seed in range(1, 1 + seeds)
        )

    def main(self, **values):
        known = [name for name in values if name in self.frame]
        keep = [self.frame[name] == values[name] for name in known]
        return self.frame[np.logical_and.reduce(keep)]

    def diagnostics(self, folder):
        level, seed = map(int, folder.split("/"))
        magnitudes = (1 + 0.01 * seed) * np.array(self.given)
        eigenvalues = np.stack([magnitudes, np.zeros_like(magnitudes)], axis=1)
        return {"imitation_error": np.array(self.error(level, seed)), "eigenvalues": eigenvalues}


def test_a_quantity_that_rises_or_falls_on_every_task_is_reproduced():
    trends = (Trend(SUCCESS, rises=True), Trend(ERROR, rises=False), Trend(TIME, rises=True))
    for trend in trends:
        found = judge(claim(trend, relevant=0.5), Kodex())
        assert found.ours == "reproduced"
        assert f"{trend}: 1.00 [" in found.evidence
    assert judge(claim(Trend(ERROR, rises=True), relevant=0.5), Kodex()).ours == "contradicted"


def test_a_trend_need_not_be_strict():
    # Sets 2 and 3 change places in every seed: Spearman's correlation is 1 - 6 * 2 / 60 = 0.8.
    swapped = {1: 4.0, 2: 2.0, 3: 3.0, 4: 1.0}
    results = Kodex(error=lambda level, seed: swapped[level])
    found = measure(Trend(ERROR, rises=False), results).found
    assert found.value == pytest.approx(0.8)
    assert judge(claim(Trend(ERROR, rises=False), relevant=0.5), results).ours == "reproduced"


def test_times_of_one_seed_say_so():
    found = judge(claim(Trend(TIME, rises=True), relevant=0.5), Kodex())
    assert found.evidence.endswith("(one seed: fits of one seed are timed)")


@pytest.mark.parametrize(
    ("magnitudes", "most", "largest"),
    [
        ((0.5, 0.6, 1.1), "reproduced", "reproduced"),
        ((0.5, 0.6, 0.7), "reproduced", "contradicted"),
        ((0.5, 1.2, 1.1), "contradicted", "reproduced"),
        ((0.5, 1.1), "undecided", "reproduced"),
    ],
)
def test_verdict_on_eigenvalue_magnitudes(magnitudes, most, largest):
    results = Kodex(magnitudes=magnitudes)
    assert judge(claim(MostBelowOne("door")), results).ours == most
    assert judge(claim(LargestAboveOne("door"), relevant=0.001), results).ours == largest


def test_largest_magnitude_is_the_mean_over_seeds():
    # 1.01, 1.02 and 1.03 times 1.1: mean 1.122, error 0.011 / sqrt(3), times 4.303.
    found = measure(LargestAboveOne("door"), Kodex()).found
    assert found[:3] == pytest.approx((1.122, 1.0947, 1.1493), abs=1e-4)


@pytest.mark.parametrize(
    ("nn", "verdict"), [(30.0, "reproduced"), (4.0, "contradicted"), (6.0, "undecided")]
)
def test_verdict_on_training_time_compares_a_baseline_with_kodex(nn, verdict):
    results = Kodex()
    results.frame["fit_seconds"] = results.frame.method.map({"kodex": 2.0, "nn": nn})
    found = judge(claim(TrainsLonger("nn", "tool", 3.0)), results)
    assert found.ours == verdict
    assert f"NN Tool: {nn / 2:.1f} times as long as KODex, claimed above 3" in found.evidence


def test_a_claim_of_96_contrasts_that_are_true_at_the_margin_is_seldom_contradicted():
    level = Scenario("at the margin", (0.65, *[0.70] * 3), (0.04,) * 4, (0.03,) * 4)
    rng = generator("96 contrasts")
    tasks = [f"task {place}" for place in range(32)]
    contrasts = [
        Contrast(Setting("kodex", task), Setting(m, task), -5.0)
        for task in tasks
        for m in METHODS[1:4]
    ]
    found = []
    for _ in range(20):
        study = {task: repeated(level, 5, 100, rng) for task in tasks}
        results = Drawn(study)
        found.append(judge(claim(*contrasts), results).ours)
    assert found.count("contradicted") <= 0.05 * len(found)
    assert "reproduced" not in found


class Drawn(Results):
    """Results whose success (M, R, N) of methods is given for each task."""

    frame = pd.DataFrame()
    rows = episodes = property(lambda self: self)

    def __init__(self, success):
        self.drawn = success

    def select(self, *, task, method, **values):
        return self.drawn[task][METHODS.index(method)]

    def at_one_size(self, parts):
        return parts

    def of_selections(self, selections):
        return selections


def test_evidence_names_what_has_no_results():
    found = verdicts(Empty()).set_index("claim")
    assert set(found.ours) == {"not run"}
    assert found.evidence["kodex-ood-tool"] == "no results of KODex Tool out of distribution"
    assert found.evidence["kodex-trains-faster"] == "no training time of NN Tool"
    assert found.evidence["baselines-need-tuned-size"] == "no two sizes of NN on Tool"
    assert found.evidence["most-magnitudes-below-one"] == "no results of KODex Tool"


class Empty(Seeds):
    def __init__(self):
        super().__init__(lambda values: None)

    def main(self, **values):
        return pd.DataFrame(columns=["seed", "folder", "fit_seconds"])


def test_results_that_cannot_be_read_are_failed():
    results = Empty()
    results.of_selections = lambda selections: 1 / 0
    assert verdicts(results).set_index("claim").ours["kodex-robust"] == "failed"
