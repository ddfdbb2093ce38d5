"""The sentences that open a report, for made-up differences between methods."""

from itertools import combinations

import pandas as pd
import pytest

from reports import answer as module
from reports.answer import answer
from reports.results import Results


class MadeUp(Results):
    suffixes = {}  # noqa: RUF012
    rows = property(lambda self: self)

    def __init__(self, rates, seeds):
        self.rates_of, self.seeds = rates, seeds

    def main(self, **values):
        rows = [(m, seed) for m in ("expert", *self.rates_of) for seed in range(self.seeds)]
        frame = pd.DataFrame(rows, columns=["method", "seed"])
        return frame.assign(task="door", episodes=100)


def table_of_door(rates):
    """Returns the table of success of methods with these rates."""
    table = pd.DataFrame({"row": rates.keys(), "value": map(float, rates.values())})
    return table.assign(column="door")


@pytest.fixture
def said(monkeypatch):
    """Returns the answer for methods with these rates, of which only some pairs are told apart."""

    def answer_of(rates, apart=(), p=0.01, seeds=5):
        def pairs_of(results, evaluations):
            rows = []
            for left, right in combinations(evaluations.method.unique(), 2):
                low, high = dict(apart).get((left, right), (-1.0, 1.0))
                row = {"left": left, "right": right, "difference": (low + high) / 2}
                known = p if (left, right) in dict(apart) else 0.5
                rows.append(row | {"low": low, "high": high, "p_holm": known})
            columns = ["left", "right", "difference", "low", "high", "p_holm"]
            return pd.DataFrame(rows, columns=columns)

        monkeypatch.setattr(module, "pairs_of", pairs_of)
        (sentence,) = answer(MadeUp(rates, seeds), table_of_door(rates))
        return sentence

    return answer_of


def test_methods_are_compared_on_the_starts_that_their_table_shows(said, monkeypatch):
    """The expert has fewer episodes, and the table is cut to those."""
    shorter, counts = MadeUp.main, []

    def main(self, **values):
        rows = shorter(self, **values)
        return rows.assign(episodes=rows.episodes.where(rows.method != "expert", 20))

    monkeypatch.setattr(MadeUp, "main", main)
    said({"kodex": 90, "nn": 92})
    pairs_of = module.pairs_of
    monkeypatch.setattr(
        module, "pairs_of", lambda *given: (counts.extend(given[1].episodes), pairs_of(*given))[1]
    )
    rates = {"kodex": 90, "nn": 92}
    answer(MadeUp(rates, 5), table_of_door(rates))
    assert set(counts) == {20}


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


def test_methods_are_not_told_apart_if_p_is_large_after_correction(said):
    sentence = said({"kodex": 90, "nn": 85}, {("kodex", "nn"): (1.0, 9.0)}.items(), p=0.06)
    assert sentence == "Door: KODex and NN cannot be told apart (85.0 to 90.0%)."


def test_methods_that_tie_with_the_best_alone_are_not_said_to_tie_with_each_other(said):
    apart = {("nn", "ndp"): (1.5, 3.5)}
    assert said({"kodex": 90, "nn": 89, "ndp": 86}, apart.items()) == (
        "Door: KODex has the most, 90.0%, and cannot be told from NN and NDP."
    )


def test_answer_says_that_a_single_method_has_no_rival(said):
    assert said({"kodex": 90}) == "Door: KODex is the only method, 90.0%."


def test_answer_of_one_seed_says_what_it_speaks_of(said):
    sentence = said({"kodex": 90, "nn": 85}, seeds=1)
    assert sentence.endswith("(85.0 to 90.0%) (this fit and this controller only).")


def test_closed_loop_methods_have_a_sentence_of_their_own():
    results = MadeUp({"kodex": 96, "bc": 95.04, "flow": 90}, 3)
    results.beyond = {"bc", "flow"}
    every = table_of_door({"expert": 100, "kodex": 96, "bc": 95.04, "flow": 90})
    assert module.to_beat(results, table_of_door({"expert": 100, "kodex": 96}), every) == [
        "Closed-loop methods, which see states on the way: BC 95.0% (Door); Flow 90.0% (Door)."
    ]


def test_line_to_beat_is_that_of_the_simplest_methods():
    results = MadeUp({}, 3)
    results.beyond = set()
    table = table_of_door({"kodex": 96, "nearest": 80, "regression": 90.06})
    assert module.to_beat(results, table, table[:0]) == [
        "The line to beat: Nearest 80.0% (Door); Regression 90.1% (Door)."
    ]
