"""The sentences that open a report, for made-up differences between methods."""

from itertools import combinations

import pandas as pd
import pytest

from reports import answer as module
from reports.answer import answer
from reports.results import Results
from tasks.errors import InputError


class MadeUp(Results):
    def __init__(self, rates):
        self.rates_of, self.suffixes = rates, {}

    def main(self, **values):
        return pd.DataFrame({"task": "door", "method": ["expert", *self.rates_of]})

    def rates(self, evaluations, by):
        rows = [{"method": "expert", "value": 100.0}]
        rows += [{"method": name, "value": float(rate)} for name, rate in self.rates_of.items()]
        return pd.DataFrame(rows).assign(task="door")


@pytest.fixture
def said(monkeypatch):
    """Returns the answer for methods with these rates, of which only some pairs are told apart."""

    def answer_of(rates, apart=(), q=0.01):
        def compare(results, methods):
            if len(methods) < 2:
                raise InputError("too few")
            rows = []
            for left, right in combinations(methods, 2):
                low, high = dict(apart).get((left, right), (-1.0, 1.0))
                row = {"task": "door", "split": "test", "left": left, "right": right}
                rows.append(row | {"low": low, "high": high, "q": q})
            return pd.DataFrame(rows)

        monkeypatch.setattr(module, "compare", compare)
        (sentence,) = answer(MadeUp(rates))
        return sentence

    return answer_of


def test_answer_names_the_methods_that_tie_for_best_first(said):
    apart = {("kodex", "ndp"): (-9.2, -0.4), ("nn", "ndp"): (3.8, 9.2)}
    assert said({"kodex": 90, "nn": 92, "ndp": 85}, apart.items()) == (
        "Door: NN and KODex cannot be told apart (90.0 to 92.0%);"
        " NDP is behind NN by 4 to 9 points."
    )


def test_answer_says_which_method_leads_all_others(said):
    apart = {("kodex", "nn"): (0.3, 1.7), ("kodex", "mine"): (10.2, 20.4)}
    assert said({"kodex": 90, "nn": 89, "mine": 75}, apart.items()) == (
        "Door: KODex leads with 90.0%;"
        " NN is behind KODex by 0.3 to 1.7 and mine by 10 to 20 points."
    )


def test_methods_are_not_told_apart_if_q_is_large(said):
    sentence = said({"kodex": 90, "nn": 85}, {("kodex", "nn"): (1.0, 9.0)}.items(), q=0.06)
    assert sentence == "Door: KODex and NN cannot be told apart (85.0 to 90.0%)."


def test_methods_that_tie_with_the_best_alone_are_not_said_to_tie_with_each_other(said):
    apart = {("nn", "ndp"): (1.5, 3.5)}
    assert said({"kodex": 90, "nn": 89, "ndp": 86}, apart.items()) == (
        "Door: KODex has the most, 90.0%, and cannot be told from NN and NDP."
    )


def test_answer_says_that_a_single_method_has_no_rival(said):
    assert said({"kodex": 90}) == "Door: KODex is the only method, 90.0%."
