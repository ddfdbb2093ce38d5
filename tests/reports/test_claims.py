import numpy as np
import pandas as pd
import pytest

from reports import verdicts as module
from reports.claims import (
    CLAIMS,
    Claim,
    Contrast,
    Setting,
)
from reports.results import Results
from reports.stats import mcnemar, mean_over_tasks, paired_difference
from reports.style import TASKS
from reports.verdicts import judge_training_time, verdicts
from tasks.data import generator


class Rates(Results):
    """Results in which each setting has a chosen rate, with noise shared by all on a start."""

    frame = pd.DataFrame()

    def __init__(self, rates, starts=400):
        self.rates, self.starts = rates, starts

    def paired_success(self, selections):
        return [self.one(**values) for values in selections]

    def one(self, **values):
        rate = self.rates.get((values["method"], values["physics"]))
        if rate is None:
            return None
        seeds = 1 if values["method"] == "kodex" else 5
        hard = generator("hardness").random(self.starts)
        own = generator("own", str(values)).random((seeds, self.starts))
        return 0.8 * hard + 0.2 * own < rate


KODEX, NN = Setting("kodex", "tool"), Setting("nn", "tool")


@pytest.mark.parametrize(
    ("kodex", "nn", "verdict"),
    [(0.9, 0.5, "reproduced"), (0.5, 0.9, "contradicted"), (0.7, 0.7, "undecided")],
)
def test_verdicts_follow_the_interval(kodex, nn, verdict, monkeypatch):
    monkeypatch.setattr(
        module, "CLAIMS", (Claim("c", "KODex beats NN.", "X", (Contrast(KODEX, NN),)),)
    )
    monkeypatch.setattr(module, "OTHER_CLAIMS", {})
    row = verdicts(Rates({("kodex", "nominal"): kodex, ("nn", "nominal"): nn})).iloc[0]
    assert row.ours == verdict
    assert "KODex Tool minus NN Tool" in row.evidence


def test_what_was_not_run_is_named(monkeypatch):
    monkeypatch.setattr(module, "OTHER_CLAIMS", {})
    found = verdicts(Rates({})).set_index("claim")
    assert set(found.ours) == {"not run"}
    assert found.evidence["kodex-ood-tool"] == "no results of KODex Tool ood"


def test_the_papers_own_tables_decide_what_they_can(monkeypatch):
    monkeypatch.setattr(module, "OTHER_CLAIMS", {})
    paper = verdicts(Rates({})).set_index("claim").paper
    assert paper["kodex-ood-tool"] == "published as a figure only"
    assert paper["kodex-above-expert-door"] == "holds in all 1 comparisons"
    # Table 9: KODex 19.5, expert 77.0, whatever the prose says.
    assert paper["kodex-above-expert-relocation"].startswith("fails in 1 of 1 comparisons")
    assert paper["heavy-hand-gain"].startswith("fails in")


def test_each_claim_has_its_own_name_and_says_where_it_is_from():
    names = [claim.name for claim in CLAIMS]
    assert len(set(names)) == len(names)
    assert all(claim.source.startswith("appendix ") and claim.contrasts for claim in CLAIMS)


def test_pairing_on_starts_narrows_the_interval():
    rng = generator("pairing")
    hard = rng.random(500)
    left = (hard + 0.02 * rng.standard_normal((5, 500))) < 0.7
    right = (hard + 0.02 * rng.standard_normal((5, 500))) < 0.6
    paired = paired_difference(left, right, "paired")
    apart = paired_difference(left, right[:, rng.permutation(500)], "apart")
    assert paired[0] == pytest.approx(apart[0]) == pytest.approx(left.mean() - right.mean())
    assert paired[2] - paired[1] < 0.7 * (apart[2] - apart[1])
    assert paired[1] <= paired[0] <= paired[2]


def test_the_interval_is_that_of_drawing_seeds_and_starts_one_by_one():
    rng = generator("one by one")
    left, right = rng.random((3, 60)) < 0.9, rng.random((4, 60)) < 0.7
    drawn = []
    for _ in range(4000):
        starts = rng.integers(60, size=60)
        ours, theirs = (
            np.mean([part[rng.integers(len(part)), starts].mean() for _ in part])
            for part in (left, right)
        )
        drawn.append(ours - theirs)
    _, low, high, _ = paired_difference(left, right, "by kinds", resamples=4000)
    assert [low, high] == pytest.approx(np.quantile(drawn, [0.025, 0.975]), abs=0.015)


def test_a_single_fit_has_the_interval_of_its_starts_alone():
    left = generator("single").random((1, 2000)) < 0.8
    difference, low, high, _ = paired_difference(left, np.zeros((1, 2000), bool), "single")
    error = np.sqrt(left.var() / 2000)
    assert (high - low) / 2 == pytest.approx(1.96 * error, rel=0.1)
    assert difference == left.mean()


def test_mcnemar_is_that_of_statsmodels():
    from statsmodels.stats.contingency_tables import mcnemar as of_statsmodels

    rng = generator("mcnemar")
    left, right = rng.random(80) < 0.8, rng.random(80) < 0.6
    table = [[(left & right).sum(), (left & ~right).sum()], [(~left & right).sum(), 0]]
    assert mcnemar(left, right) == pytest.approx(of_statsmodels(table, exact=True).pvalue)
    assert mcnemar(left, left) == 1.0


def test_the_interquartile_mean_leaves_out_the_best_and_worst_quarter():
    outcomes = [np.tile(np.arange(100) < 10 * rate, (1, 1)) for rate in (0, 2, 4, 10)]
    value, low, high = mean_over_tasks(outcomes, 0.25, "tasks")
    assert value == pytest.approx(0.3)
    # Two rates of 100 episodes each count: their mean's standard error is 0.032.
    assert high - low == pytest.approx(2 * 1.96 * 0.032, rel=0.1)


def test_the_interquartile_mean_covers_what_it_estimates():
    rng = generator("coverage of the interquartile mean")
    rates, covered = np.array([0.2, 0.5, 0.6, 0.9]), 0
    for study in range(200):
        outcomes = [rng.random((1, 100)) < rate for rate in rates]
        _, low, high = mean_over_tasks(outcomes, 0.25, study, resamples=400)
        covered += low <= 0.55 <= high
    assert covered >= 180


class Timed(Results):
    """Results that know how long fits took."""

    def __init__(self, seconds):
        self.frame = pd.DataFrame(
            {"task": task, "method": method, "fit_seconds": time}
            for method, time in seconds.items()
            for task in TASKS
        )

    def main(self, **values):
        return self.frame


@pytest.mark.parametrize(
    ("nn", "verdict"), [(30.0, "reproduced"), (4.0, "contradicted"), (np.nan, "not run")]
)
def test_training_times_are_compared_with_kodex(nn, verdict):
    seconds = {"kodex": 2.0, "nn": nn, "lstm": 50.0, "ndp": 20.0, "ngf": 40.0}
    found, evidence = judge_training_time(Timed(seconds))
    assert found == verdict
    assert ("NDP 10 to 10" in evidence) == (found != "not run")
