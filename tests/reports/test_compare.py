import json
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from scipy.stats import ttest_rel
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.power import TTestPower

from bench.names import PLAIN
from reports.compare import as_text, compare
from reports.exhibits.success import EXHIBIT as SUCCESS
from reports.failing import evaluations
from reports.pairs import letters_of, pairs_of, smallest_shown
from reports.results import Results
from reports.seed_statistics import ONE_SEED, OVER_SEEDS
from tasks.errors import InputError

# Percent of 1,000 starts that each of five seeds succeeds from.
PERCENTS = {
    "kodex": (55, 57, 53, 59, 56),
    "nn": (50, 59, 49, 58, 54),
    "ndp": (40, 38, 41, 37, 39),
    "expert": (100, 100, 100, 100, 100),
}


class Rates(Results):
    """Results on Door in which a seed succeeds from its first starts."""

    source = None
    mixed = None

    def __init__(self, percents=PERCENTS, seeds=5):
        same = {"task": "door", "variant": "described", "size": "one", "demos": 200}
        same |= {"held_out": 0, "demos_key": "k", "pins": "p", "controller_key": "", "config": {}}
        same |= PLAIN | {"episodes": 1000, "split": "test"}
        self.frame = pd.DataFrame(
            {**same, "method": method, "seed": seed, "folder": f"{method}-{seed}"}
            | {"controller": "none" if method == "expert" else "original"}
            | {"successes": 10 * share}
            for method, shares in percents.items()
            for seed, share in enumerate(shares[:seeds], 1)
        )

    frame = pd.DataFrame()

    def outcomes(self, row):
        success = np.arange(row["episodes"]) < row["successes"]
        return pd.DataFrame({"success": success, "diverged": False})


def test_pairs_are_compared_by_the_paired_t_over_seeds_and_by_holm():
    table = compare(Rates(), ["kodex", "nn", "ndp"])
    assert [*zip(table.left, table.right, strict=True)] == [
        ("kodex", "nn"),
        ("kodex", "ndp"),
        ("nn", "ndp"),
    ]
    for row in table.to_dict("records"):
        oracle = ttest_rel(PERCENTS[row["left"]], PERCENTS[row["right"]])
        interval = oracle.confidence_interval(0.95)
        assert row["difference"] == pytest.approx(row["left rate"] - row["right rate"])
        assert (row["low"], row["high"]) == pytest.approx((interval.low, interval.high), abs=0.1)
        assert row["p"] == pytest.approx(oracle.pvalue, rel=0.1)
        gaps = np.subtract(PERCENTS[row["left"]], PERCENTS[row["right"]])
        size = TTestPower().solve_power(nobs=5, alpha=0.05, power=0.8)
        assert row["deviation"] == pytest.approx(gaps.std(ddof=1))
        assert row["detectable"] == pytest.approx(size * gaps.std(ddof=1), rel=1e-4)
    np.testing.assert_allclose(table.p_holm, multipletests(table.p, method="holm")[1])
    assert (set(table.seeds), set(table.n), set(table.basis)) == ({5}, {1000}, {OVER_SEEDS})


def test_single_seeds_are_compared_by_mcnemar_and_labelled():
    table = compare(Rates(seeds=1), ["kodex", "nn"])
    (row,) = table.to_dict("records")
    # Both succeed from 500 starts, KODex alone from 50 more.
    assert row["p"] == pytest.approx(mcnemar([[500, 50], [0, 450]], exact=True).pvalue)
    assert row["basis"] == ONE_SEED
    assert np.isnan(row["detectable"])
    text = as_text(table, {})
    assert "+5.0 [3.6, 6.4]†" in text
    assert "† One seed: interval and p speak of this fit and this controller only." in text
    assert "†" not in as_text(compare(Rates(), ["kodex", "nn"]), {})


def test_command_prints_p_after_holm_and_what_the_seeds_could_have_shown(bench, monkeypatch):
    monkeypatch.setattr("reports.cli._open", lambda *arguments: Rates())
    monkeypatch.setattr("reports.cli._print_notes", lambda *arguments: None)
    code, said, _ = bench("compare", "--reference", "--methods", "kodex,nn,ndp")
    assert code == 0
    heads = [cell.strip() for cell in said.splitlines()[0].split("|")]
    assert {"p", "p_holm", "detectable", "seeds", "starts of each"} <= set(heads)
    assert "Holm" in said
    assert "The expert of a task is fixed and outside every interval." in said
    code, said, _ = bench("compare", "--reference", "--methods", "kodex,expert", "--json")
    (row,) = json.loads(said)
    assert (row["left"], row["right"], row["seeds"]) == ("kodex", "expert", 5)


@pytest.mark.parametrize(
    ("methods", "answer"),
    [(["kodx", "nn"], "did you mean 'kodex'"), (["nn", "nn"], "two or more methods")],
)
def test_compare_refuses_unknown_methods_and_single_methods(methods, answer):
    with pytest.raises(InputError, match=answer):
        compare(Rates(), methods)


def test_compare_refuses_methods_without_a_common_seed():
    results = Rates()
    results.frame = results.frame.query(
        "method == 'nn' and seed > 3 or method == 'kodex' and seed < 3"
    )
    with pytest.raises(InputError, match="kodex, nn have no seed in common"):
        compare(results, ["kodex", "nn"])


def test_a_difference_that_no_seeds_could_show_is_not_given_as_a_number():
    table = SUCCESS.table(Rates()).assign(detectable=193.0)
    assert SUCCESS.caption(table).endswith("[points]: Door more than 100.")


def test_table_of_a_study_worked_by_hand_has_its_letters_and_smallest_difference():
    """The study of three methods and five seeds of test_seed_statistics, seen in the table.

    Differences of seeds: KODex - NN 5, -2, 4, 1, 2 (squared deviations from 2: 30), KODex - NDP
    15, 19, 12, 22, 17 (from 17: 58), NN - NDP 10, 21, 8, 21, 15 (from 15: 146). Each divided by
    4: variances 7.5, 14.5 and 36.5, mean 19.5, root 4.416. The test of five seeds finds 1.682
    standard deviations in 80% of studies: 7.4 points. p is 0.178, 0.0006 and 0.0052, times 1, 3
    and 2: KODex and NN share a letter, and NDP differs from both.
    """
    table = SUCCESS.table(Rates())
    letters = dict(zip(table.row, table.letters, strict=True))
    assert letters == {"expert": "", "kodex": "a", "nn": "a", "ndp": "b"}
    values = dict(zip(table.row, table.value, strict=True))
    assert values == pytest.approx({"expert": 100, "kodex": 56, "nn": 54, "ndp": 39})
    assert table.detectable.unique() == pytest.approx(7.43, abs=0.01)
    caption = SUCCESS.caption(table)
    assert "share a letter cannot be told apart" in caption
    assert caption.endswith("without correction [points]: Door 7.4.")
    assert "5 seeds, each with 1,000 starts of its own." in caption
    wide = SUCCESS.wide(table).set_index("").Door
    assert wide["KODex"].endswith("] a")
    assert wide["NDP"].endswith("] b")
    assert wide["Expert"].endswith("]")


def test_table_of_one_seed_is_marked_and_says_what_it_speaks_of():
    table = SUCCESS.table(Rates(seeds=1))
    assert set(table.basis) == {ONE_SEED}
    assert SUCCESS.wide(table).set_index("").Door["KODex"] == "55.0 [51.9, 58.1]† a"
    caption = SUCCESS.caption(table)
    assert "† One seed: the 95% interval (Wilson's) and the letters speak of this fit" in caption
    assert "What difference could have been missed is unknown" in caption
    assert "1 seed with 1,000 starts." in caption


def test_letters_are_those_of_a_naive_loop():
    percents = {f"m{i}": np.array([50, 52, 48, 53, 47]) + 3 * i for i in range(6)}
    wobble = [[0, 1, -1, 0, 2], [2, -2, 1, 0, 0], [-3, 3, 0, 1, -1]]
    wobble += [[1, 1, 0, -2, 0], [-1, 0, 2, 2, -2], [2, 0, -2, 0, 1]]
    shares = {m: tuple(p + w) for (m, p), w in zip(percents.items(), wobble, strict=True)}
    results = Rates(shares)
    pairs = pairs_of(results, results.frame)
    letters = letters_of(pairs, {m: np.mean(p) for m, p in shares.items()})
    p_values = [ttest_rel(shares[a], shares[b]).pvalue for a, b in combinations(shares, 2)]
    adjusted = multipletests(p_values, method="holm")[1]
    found = set()
    for (one, other), p in zip(combinations(shares, 2), adjusted, strict=True):
        shared = bool(set(letters[one]) & set(letters[other]))
        assert shared == (p > 0.05), (one, other, p)
        found.add(shared)
    assert found == {True, False}
    assert letters["m5"][0] == "a"


def test_methods_that_were_not_all_compared_have_no_letters():
    pairs = compare(Rates(), ["kodex", "nn"])
    assert letters_of(pairs, {"kodex": 56, "nn": 54, "ndp": 39}) == {}
    assert letters_of(pairs, {"kodex": 56}) == {}


def test_seeds_that_all_differ_alike_do_not_say_what_they_could_have_shown():
    results = Rates({"kodex": (60, 70, 80), "nn": (50, 60, 70)})
    pairs = pairs_of(results, results.frame)
    assert np.isnan(pairs.detectable).all()
    assert np.isnan(smallest_shown(pairs))


def test_closed_loop_methods_are_compared_where_they_are_named():
    results = Rates(PERCENTS | {"bc": (90, 91, 92, 93, 94), "flow": (80, 81, 82, 83, 84)})
    assert not results.rows.select().method.isin(["bc", "flow"]).any()
    for names in (["kodex", "bc"], ["bc", "flow"]):
        (row,) = compare(results, names).itertuples()
        assert [row.left, row.right] == names
    assert len(evaluations(results, "door", "bc", "test", None)) == 5
