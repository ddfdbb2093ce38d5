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
from reports.style import TASKS
from reports.verdicts import judge_training_time, verdicts
from tasks.data import generator


class Rates(Results):
    """Results with a chosen rate for each setting. Hard starts are hard for all settings."""

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
def test_verdict_depends_on_the_interval_of_the_contrast(kodex, nn, verdict, monkeypatch):
    monkeypatch.setattr(
        module, "CLAIMS", (Claim("c", "KODex beats NN.", "X", (Contrast(KODEX, NN),)),)
    )
    monkeypatch.setattr(module, "OTHER_CLAIMS", {})
    row = verdicts(Rates({("kodex", "nominal"): kodex, ("nn", "nominal"): nn})).iloc[0]
    assert row.ours == verdict
    assert "KODex Tool minus NN Tool" in row.evidence


def test_evidence_names_the_setting_without_results(monkeypatch):
    monkeypatch.setattr(module, "OTHER_CLAIMS", {})
    found = verdicts(Rates({})).set_index("claim")
    assert set(found.ours) == {"not run"}
    assert found.evidence["kodex-ood-tool"] == "no results of KODex Tool ood"


def test_claims_are_judged_by_the_papers_tables_where_they_have_numbers(monkeypatch):
    monkeypatch.setattr(module, "OTHER_CLAIMS", {})
    paper = verdicts(Rates({})).set_index("claim").paper
    assert paper["kodex-ood-tool"] == "published as a figure only"
    assert paper["kodex-above-expert-door"] == "holds in 1 of 1 comparison"
    # Table 9: KODex 19.5, expert 77.0, whatever the prose says.
    assert paper["kodex-above-expert-relocation"].startswith("fails in 1 of 1 comparison")
    assert paper["heavy-hand-gain"].startswith("fails in")


def test_claims_have_distinct_names_and_a_source():
    names = [claim.name for claim in CLAIMS]
    assert len(set(names)) == len(names)
    assert all(claim.source.startswith("appendix ") and claim.contrasts for claim in CLAIMS)


class Timed(Results):
    """Results with a training time for each method."""

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
def test_verdict_on_training_time_compares_baselines_with_kodex(nn, verdict):
    seconds = {"kodex": 2.0, "nn": nn, "lstm": 50.0, "ndp": 20.0, "ngf": 40.0}
    found, evidence = judge_training_time(Timed(seconds))
    assert found == verdict
    assert ("NDP 10 to 10" in evidence) == (found != "not run")
