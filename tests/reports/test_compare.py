import numpy as np
import pandas as pd
import pytest
from statsmodels.stats.multitest import multipletests

from reports.compare import compare
from reports.results import Results
from tasks.data import generator
from tasks.errors import InputError

RATES = {"kodex": (1, 0.8), "nn": (5, 0.6), "ndp": (5, 0.6), "expert": (1, 0.8)}


class Rates(Results):
    """Results in which a method fails on the hardest starts."""

    def __init__(self):
        pass

    frame = pd.DataFrame(
        [
            {
                "method": m,
                "variant": "described",
                "physics": "nominal",
                "controller": c,
                "rule": "appendix",
            }
            for m, c in zip(RATES, ("original", "original", "original", "none"), strict=True)
        ]
    )

    def paired_success(self, selections):
        return [self.one(**values) for values in selections]

    def one(self, *, method, task, split, controller):
        if task != "door" or split != "test":
            return None
        assert controller == ("none" if method == "expert" else "original")
        seeds, rate = RATES[method]
        hard = generator("hard").random(1000) + 0.05 * generator(method).random((seeds, 1000))
        return hard < rate


def test_compare_gives_each_pair_an_interval_p_and_q():
    table = compare(Rates(), ["kodex", "nn", "ndp"])
    assert list(zip(table.left, table.right, strict=True)) == [
        ("kodex", "nn"),
        ("kodex", "ndp"),
        ("nn", "ndp"),
    ]
    clear, equal = table.iloc[0], table.iloc[2]
    assert clear.low <= clear.difference <= clear.high
    assert clear.difference == pytest.approx(20, abs=3)
    assert clear.p < 0.01
    assert equal.low <= 0 <= equal.high
    assert equal.p > 0.05
    np.testing.assert_allclose(table.q, multipletests(table.p, method="fdr_bh")[1])


def test_compare_accepts_two_single_fits():
    table = compare(Rates(), ["kodex", "expert"])
    assert table.p.iloc[0] > 0.05
    assert table.n.iloc[0] == 1000


@pytest.mark.parametrize(
    ("methods", "answer"),
    [(["kodx", "nn"], "did you mean 'kodex'"), (["nn", "nn"], "two or more methods")],
)
def test_compare_refuses_unknown_methods_and_single_methods(methods, answer):
    with pytest.raises(InputError, match=answer):
        compare(Rates(), methods)
