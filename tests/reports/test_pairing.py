"""Compared methods have common seeds, and common starts within each seed."""

import numpy as np
import pandas as pd
import pytest

from bench.names import PLAIN
from reports.answer import answer
from reports.compare import compare
from reports.exhibits.success import success_of
from reports.pairing import keep_common
from reports.results import Results


class Stored(Results):
    """Evaluations on test starts, in which method mN succeeds from the first N of every ten.

    Seed r begins r starts later, so that start i of one seed is not start i of another.
    """

    frame = pd.DataFrame()

    def __init__(self, evaluations):
        common = PLAIN | {"variant": "described", "size": "one"}
        common |= {"split": "test", "demos": 10, "controller": "original", "successes": 0}
        names = ["task", "method", "seed", "episodes"]
        self.frame = pd.DataFrame(evaluations, columns=names).assign(**common)
        self.frame["folder"] = [
            f"{row.task}-{row.method}-{row.seed}" for row in self.frame.itertuples()
        ]

    def outcomes(self, row):
        place = np.arange(row["episodes"]) + row["seed"]
        success = (place % 10 < int(row["method"][1:])) & (np.arange(row["episodes"]) < 100)
        return pd.DataFrame({"success": success, "diverged": False})


@pytest.fixture
def stored():
    """Methods with unequal starts and seeds on Door, and without a common seed on Tool."""
    rows = [("door", "m4", seed, 1000) for seed in (1, 2, 3)]
    rows += [("door", "m3", seed, 100) for seed in (2, 3, 4)]
    rows += [("door", "m5", seed, 500) for seed in (5, 3, 2)]
    return Stored([*rows, ("tool", "m4", 1, 50), ("tool", "m3", 2, 60)])


def test_rates_use_common_seeds_and_starts(stored):
    table = stored.episodes.rates(stored.frame, ["method", "task"]).set_index(["task", "method"])
    assert table.n.to_dict() == {
        ("door", "m4"): 100,
        ("door", "m3"): 100,
        ("door", "m5"): 100,
        ("tool", "m4"): 50,
        ("tool", "m3"): 50,
    }
    assert dict(table.loc["door"].value) == {"m4": 40, "m3": 30, "m5": 50}
    assert dict(table.loc["door"].seeds) == {"m4": 2, "m3": 2, "m5": 2}
    assert set(table.loc["door"].basis) == {"over seeds"}
    assert set(table.loc["tool"].basis) == {"this fit and this controller only"}


def chosen(stored, at, *methods):
    rows = [stored.rows.main(method=method, **at) for method in methods]
    return stored.episodes.of_selections(rows)


def test_two_methods_are_paired_by_seed_and_by_start_of_the_seed(stored):
    at = {"task": "door", "split": "test"}
    left, right = chosen(stored, at, "m4", "m3")
    assert left.shape == right.shape == (2, 100)
    for place, seed in enumerate((2, 3)):
        numbers = (np.arange(100) + seed) % 10
        np.testing.assert_array_equal(left[place], numbers < 4)
        np.testing.assert_array_equal(right[place], numbers < 3)


def test_rows_of_seeds_in_another_order_are_paired_by_seed(stored):
    at = {"task": "door", "split": "test"}
    left, right = chosen(stored, at, "m4", "m5")
    assert left.shape == (2, 500)
    assert (left <= right).all()


def test_methods_without_a_common_seed_are_not_paired(stored):
    at = {"task": "tool", "split": "test"}
    assert chosen(stored, at, "m4", "m3") == [None, None]
    (alone, missing) = chosen(stored, at, "m4", "m5")
    assert alone.shape == (1, 50)
    assert missing is None


def test_compare_uses_seeds_and_starts_that_all_compared_methods_have(stored):
    pairs = compare(stored, ["m4", "m3", "m5"]).set_index(["task", "left", "right"])
    places = [("door", "m4", "m3"), ("door", "m4", "m5"), ("door", "m3", "m5")]
    assert pairs.n.to_dict() == dict.fromkeys(places, 100)
    assert set(pairs.seeds) == {2}
    assert pairs.difference["door", "m4", "m3"] == pytest.approx(10)


def test_keep_common_keeps_all_seeds_if_fewer_than_two_are_common(stored):
    tool = stored.frame[stored.frame.task == "tool"]
    assert set(keep_common(tool).seed) == {1, 2}


def test_the_expert_does_not_decide_which_seeds_are_common():
    rows = [("door", "m4", seed, 100) for seed in (1, 2, 3)]
    rows += [("door", "m3", seed, 100) for seed in (2, 3)]
    found = keep_common(Stored([*rows, ("door", "expert", 3, 100)]).frame)
    seeds = found.groupby("method").seed.agg(set).to_dict()
    assert seeds == {"m4": {2, 3}, "m3": {2, 3}, "expert": {3}}


def test_methods_with_other_seeds_get_no_letters_and_no_place_in_the_answer():
    rows = [("door", "m4", seed, 100) for seed in (1, 2, 3)]
    rows += [("door", "m3", seed, 100) for seed in (1, 2, 3)]
    assert set(success_of(Stored(rows), Stored(rows).frame).letters) == {"a", "b"}
    unlike = Stored([*rows, ("door", "m5", 1, 100)])
    table = success_of(unlike, unlike.frame)
    assert table.set_index("row").seeds.to_dict() == {"m4": 3, "m3": 3, "m5": 1}
    assert set(table.letters) == {""}
    assert answer(unlike, table) == ["Door: methods have different seeds, so none is ahead."]
