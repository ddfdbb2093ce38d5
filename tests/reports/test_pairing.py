"""Compared methods have common starts and seeds."""

import numpy as np
import pandas as pd
import pytest

from reports.compare import compare
from reports.pairing import keep_common
from reports.results import Results


class Stored(Results):
    """Evaluations on test starts, in which method mN succeeds from the first N of every ten."""

    frame = pd.DataFrame()

    def __init__(self, evaluations):
        common = {"variant": "described", "size": "one", "physics": "nominal", "rule": "appendix"}
        common |= {"split": "test", "demos": 10, "controller": "original", "successes": 0}
        names = ["task", "method", "seed", "episodes"]
        self.frame = pd.DataFrame(evaluations, columns=names).assign(**common)

    def outcomes(self, row):
        success = np.arange(row["episodes"]) % 10 < int(row["method"][1:])
        success &= np.arange(row["episodes"]) < 100
        return pd.DataFrame({"success": success, "diverged": False})


@pytest.fixture
def stored():
    """Methods with unequal starts on Door and unequal seeds on Tool. Method m5 has no seeds."""
    rows = [("door", "m4", seed, 1000) for seed in (1, 2, 3)]
    rows += [("door", "m3", seed, 100) for seed in (2, 3, 4)] + [("door", "m5", 0, 500)]
    return Stored([*rows, ("tool", "m4", 1, 50), ("tool", "m3", 2, 60)])


def test_rates_use_common_starts_and_seeds(stored):
    table = stored.rates(stored.frame, ["method", "task"]).set_index(["task", "method"])
    assert table.n.to_dict() == {
        ("door", "m4"): 100,
        ("door", "m3"): 100,
        ("door", "m5"): 100,
        ("tool", "m4"): 50,
        ("tool", "m3"): 50,
    }
    assert dict(table.loc["door"].value) == {"m4": 40, "m3": 30, "m5": 50}
    assert dict(table.loc["door"].seeds) == {"m4": 2, "m3": 2, "m5": 1}


def test_compare_uses_common_starts_and_seeds(stored):
    pairs = compare(stored, ["m4", "m3", "m5"]).set_index(["task", "left", "right"])
    assert pairs.n.to_dict() == {
        ("door", "m4", "m3"): 100,
        ("door", "m4", "m5"): 500,
        ("door", "m3", "m5"): 100,
        ("tool", "m4", "m3"): 50,
    }
    assert pairs.difference["door", "m4", "m3"] == pytest.approx(10)


def test_keep_common_keeps_all_seeds_if_fewer_than_two_are_common(stored):
    tool = stored.frame[stored.frame.task == "tool"]
    assert set(keep_common(tool).seed) == {1, 2}
