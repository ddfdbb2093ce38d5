"""Numbers of the pages of results from the shipped files, all but letters with pandas alone."""

import re
from itertools import combinations
from pathlib import Path

import pandas as pd
import pytest
from scipy.stats import ttest_1samp

import bench
from bench.packed import shipped
from reports.exhibits.two_experts import by_expert
from reports.results import Results
from tasks.errors import InputError

ROOT = Path(__file__).parents[2]
PAGES = ("results.md", "beyond_the_paper.md")
PAGE = "\n".join((ROOT / "docs" / page).read_text() for page in PAGES)
TEXT = " ".join(PAGE.split())
STORED = pd.read_parquet(ROOT / "reports/reference/evaluations.parquet")
EVERYTHING = STORED.query("replan == 0")
NOMINAL = EVERYTHING.query("physics == 'nominal'")
LEARNT = NOMINAL.query("variant == 'described'")
EVALUATIONS = LEARNT.query("demos == 200 or method == 'expert'")
UNDISTURBED = EVALUATIONS.query("disturbance == 'none'")
TASKS = ["tool", "door", "relocation", "reorientation"]
ACTING = ("expert", "bc", "chunk", "flow")
"""They need no controller."""
SIZES = ["large", "median", "small", "single"]
"""In the order of those of equal success, the last one first."""


def rates(rows: pd.DataFrame) -> pd.Series:
    """The success of each evaluation in per cent."""
    return 100 * rows["successes"] / rows["episodes"]


def validated() -> pd.Series:
    """The success in per cent from validation starts by method, task and size."""
    rows = UNDISTURBED.query("split == 'validation' and demos == 200 and expert == 'first'")
    return rates(rows).groupby([rows["method"], rows["task"], rows["size"]]).mean()


def at_best_size(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows of each method and task in the size, of those in the rows, that validates best."""
    means = validated().round(9)
    ranks = [
        (means.get((one.method, one.task, one.size_), -1), SIZES.index(one.size_))
        for one in rows.rename(columns={"size": "size_"}).itertuples()
    ]
    rows = rows.assign(rank=pd.Series(ranks, rows.index))
    return rows[rows["rank"] == rows.groupby(["method", "task"])["rank"].transform("max")]


def success(split: str) -> pd.Series:
    """The success in per cent by method, task and seed; the first expert taught."""
    rows = at_best_size(UNDISTURBED.query("split == @split and expert == 'first'"))
    return rates(rows).groupby([rows["method"], rows["task"], rows["seed"]]).first()


@pytest.mark.parametrize("split", ["test", "ood"])
def test_plain_episodes_are_those_of_the_main_comparison(split):
    episodes = bench.open().plain(split)
    means = 100 * episodes.groupby(["method", "task", "seed"], observed=True)["success"].mean()
    assert means.to_dict() == pytest.approx(success(split).to_dict())


def test_plain_episodes_of_an_unknown_split_are_refused():
    with pytest.raises(
        InputError, match=r"unknown split with results 'tets': .* did you mean 'test'"
    ):
        bench.open().plain("tets")


def table(below: str) -> dict[str, list[str]]:
    """The cells of the first table below a line of the page, by the name of the row."""
    lines = re.search(r"(?:^\|.*\n)+", PAGE[PAGE.index(below) :], re.MULTILINE)[0].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]
    return {name.lower(): cells for name, *cells in rows}


def printed(cell: str) -> list[float]:
    """The mean and the standard deviation that a cell begins with."""
    return [float(number) for number in re.findall(r"[\d.]+", cell)[:2]]


def rounded(seeds: pd.Series) -> object:
    """The mean and the standard deviation of the rates of seeds, to the last printed digit."""
    return pytest.approx([seeds.mean(), seeds.std()], abs=0.05 + 1e-9)


@pytest.mark.parametrize(
    ("split", "name", "methods"),
    [("test", "success", 8), ("ood", "figure_5", 8), ("ood", "beyond_ood", 11)],
)
def test_means_and_deviations_of_each_task(split, name, methods):
    found, shown = success(split), table(f"<!-- {name} -->")
    assert len(shown) == methods
    for method, cells in shown.items():
        for task, cell in zip(TASKS, cells, strict=True):
            assert printed(cell) == rounded(found[method][task]), (method, task)


def test_means_over_tasks():
    for split, column in (("test", 0), ("ood", 2)):
        found = success(split).groupby(["method", "seed"]).mean()
        for method, cells in table("<!-- all_tasks -->").items():
            assert printed(cells[column]) == rounded(found[method]), (method, split)


def test_the_success_of_each_seed():
    found = success("test")
    for method, cells in table("## How much seeds vary").items():
        for task, cell in zip(TASKS, cells, strict=True):
            seeds = [f"{rate:.1f}".removesuffix(".0") for rate in found[method][task]]
            assert [one.removesuffix(".0") for one in cell.split(", ")] == seeds, (method, task)


def test_pages_name_the_seeds_of_the_shipped_results():
    seeds = success("test").index.get_level_values("seed")
    assert {*seeds} == {*range(1, max(seeds) + 1)}
    for page in ("submit.md", "add_a_method.md"):
        assert f"--seeds {max(seeds)}" in (ROOT / "docs" / page).read_text(), page


def test_success_by_size():
    means = validated()
    shown = table("## The size of networks")
    assert len(shown) == 12
    for name, cells in shown.items():
        method, size = name.split()
        for task, cell in zip(TASKS, cells, strict=True):
            mean = pytest.approx(means[method, task, size], abs=0.05 + 1e-9)
            assert printed(cell)[0] == mean, (name, task)


def test_success_of_other_sizes_from_test_starts():
    rows = UNDISTURBED.query("split == 'test' and expert == 'first'")
    means = rates(rows).groupby([rows["method"], rows["task"], rows["size"]]).mean().round(1)
    for method, numbers in (("nn", "81.0 and 85.0%"), ("ndp", "84.6 and 76.3%")):
        door = means[method, "door"]
        assert numbers == f"{door['large']} and {door['median']}%"
        assert numbers in TEXT
    outside = UNDISTURBED.query("split == 'ood' and expert == 'first' and task == 'tool'")
    means = rates(outside).groupby([outside["method"], outside["size"]]).mean().round(1)
    assert f"NGF has {means['ngf', 'small']}% in small and {means['ngf', 'large']}% in" in TEXT
    assert f"LSTM {means['lstm', 'small']} in small and {means['lstm', 'large']} in large" in TEXT
    of_lstm = rows.query("method == 'lstm' and task == 'reorientation' and seed == 5")
    assert sorted(rates(of_lstm).round()) == [42, 74]
    assert "median network succeeds in 42%, the large one in 74%" in TEXT


def success_of(rows: pd.DataFrame, by: list[str]) -> pd.Series:
    """The success in per cent of all seeds, from the first ``common`` starts of each evaluation."""
    episodes = pd.read_parquet(ROOT / "reports/reference/episodes.parquet").drop(columns="diverged")
    found = episodes.join(rows, on="evaluation", how="inner").query("start < common")
    return 100 * found.groupby(by)["success"].mean()


def widest(rows: pd.DataFrame, by: str) -> pd.DataFrame:
    """The rows in the size that has the most conditions: NN has two on some tasks."""
    counts = rows.groupby(["method", "task", "size"])[by].transform("nunique")
    return rows[counts == counts.groupby([rows["method"], rows["task"]]).transform("max")]


def on_fits_of(rows: pd.DataFrame, others: pd.DataFrame) -> pd.DataFrame:
    """The rows whose task, method, size and seed the others have too."""
    keys = ["task", "method", "size", "seed"]
    return rows[rows.set_index(keys).index.isin(others.set_index(keys).index)]


@pytest.mark.parametrize("split", ["test", "ood"])
def test_what_the_second_expert_changes(split):
    rows = UNDISTURBED.query("split == @split")
    rows = on_fits_of(rows, rows.query("expert == 'second'"))
    rows = rows.assign(common=rows.groupby(["method", "task"])["episodes"].transform("min"))
    means = success_of(rows, ["method", "task", "expert"]).unstack()
    change = means["second"] - means["first"]
    shown = table(f"<!-- expert_change_{split} -->")
    assert len(shown) == 8
    for method, cells in shown.items():
        for task, cell in zip(TASKS, cells, strict=True):
            value = float(cell.split(" ")[0])
            assert value == pytest.approx(change[method][task], abs=0.05 + 1e-9), (method, task)


def disturbed_success() -> pd.Series:
    """The success in per cent by method, task and disturbance, from common starts of a task."""
    rows = EVALUATIONS.query("split == 'test' and expert == 'first'")
    disturbed = widest(rows.query("disturbance != 'none'"), "disturbance")
    rows = on_fits_of(rows, disturbed)
    rows = rows.assign(common=rows["task"].map(disturbed.groupby("task")["episodes"].min()))
    return success_of(rows, ["method", "task", "disturbance"])


def test_success_of_flow_with_late_actions():
    means = disturbed_success()
    flow, expert = means["flow"].round(1), means["expert"].round(1)
    assert [flow[task, "late_1"] for task in ("tool", "relocation", "door")] == [100, 100, 24.7]
    late = [f"{one[task, 'late_2']}" for one in (flow, expert) for task in ("tool", "relocation")]
    said = re.search(r"([\d.]+) and ([\d.]+)% with two \(the expert ([\d.]+) and ([\d.]+)%", TEXT)
    assert list(said.groups()) == late


def test_success_with_joints_off():
    means = disturbed_success()
    names = ("none", "joints_off_0.02", "joints_off_0.05")
    shown = table("## When something is off")
    assert len(shown) == 11
    for method, cells in shown.items():
        for task, cell in zip(TASKS, cells, strict=True):
            assert cell == ", ".join(f"{means[method, task, name]:.1f}" for name in names)


def test_success_of_motions_that_are_predicted_anew():
    rows = STORED.query(
        "split == 'test' and physics == 'nominal' and variant == 'described' and expert == 'first'"
        " and demos == 200"
    )
    anew = rows.query("replan > 0")
    rows = on_fits_of(rows, anew).assign(common=anew["episodes"].min())
    means = success_of(rows, ["method", "task", "disturbance", "replan"])
    names = {"": "none", "hinges off": "joints_off_0.05", "late": "late_1"}
    shown = table("## Predicting anew on the way")
    assert len(shown) == 9
    for name, cells in shown.items():
        method, _, when = name.partition(", ")
        for task, cell in zip(TASKS, cells, strict=True):
            found = [f"{means[method, task, names[when], often]:.1f}" for often in (0, 20, 5, 1)]
            assert cell == ", ".join(found), (name, task)


def test_success_of_methods_trained_as_in_the_authors_code():
    published = NOMINAL.query("variant == 'published'")
    both = pd.concat([published, on_fits_of(UNDISTURBED.query("split == 'test'"), published)])
    rows = both.query("expert == 'first'").assign(common=published["episodes"].min())
    means = success_of(rows, ["method", "task", "variant"]).round(1)
    shown = table("## Trained as in the authors' code")
    assert len(shown) == 4
    for method, cells in shown.items():
        for task, cell in zip(TASKS, cells, strict=True):
            found = [means[method, task, how] for how in ("described", "published")]
            assert cell.startswith(f"{found[0]}, {found[1]} ("), (method, task)
    nn = published.query("method == 'nn'")
    diverged, episodes = nn["diverged"].sum(), nn["episodes"].sum()
    assert f"{diverged} of {episodes:,} episodes diverge" in TEXT
    assert f"In four of the {len(nn)} fits" in TEXT.replace("twelve", "12")
    assert (nn["diverged"] > 0).sum() == 4


def test_success_from_few_demonstrations():
    rows = LEARNT.query("split == 'test' and expert == 'first' and disturbance == 'none'")
    holds_out = rows.groupby("method")["held_out"].transform("max") > 0
    rows = rows[~holds_out | (rows["held_out"] > 0)].query("method != 'expert'")
    rows = rows.assign(given=rows["demos"] + rows["held_out"])
    few = rows.query("given < 200")
    keys = ["task", "method", "seed"]
    rows = rows[rows.set_index(keys).index.isin(few.set_index(keys).index)]
    by = ["task", "given", "method", "seed"]
    by_seed = success_of(rows.assign(common=few["episodes"].min()), by)
    overall = pd.concat({"mean": by_seed.groupby(by[1:]).mean()}, names=["task"])
    by_seed = pd.concat([by_seed, overall]).sort_index()
    for task, given, better, worse, said in (
        ("mean", 10, "kodex", "lstm", "ahead of LSTM by {} points [{}, {}]"),
        ("mean", 10, "kodex", "ngf", "of NGF by {} [{}, {}], and behind"),
        ("mean", 10, "regression", "kodex", "behind Regression by {} [{}, {}]"),
        ("mean", 25, "kodex", "lstm", "ahead of LSTM by {} [{}, {}]"),
        ("mean", 25, "kodex", "ndp", "of NDP by {} [{}, {}]"),
        ("mean", 25, "kodex", "ngf", "of NGF by {} [{}, {}] and of"),
        ("mean", 25, "kodex", "nearest", "of Nearest by {} [{}, {}]"),
        ("mean", 50, "kodex", "lstm", "ahead of LSTM by {} [{}, {}]"),
        ("mean", 50, "kodex", "ndp", "of NDP by {} [{}, {}]"),
        ("mean", 100, "kodex", "lstm", "ahead of LSTM by {} [{}, {}]"),
        ("mean", 100, "kodex", "ngf", "of NGF by {} [{}, {}]"),
        ("mean", 150, "kodex", "ndp", "of NDP by {} [{}, {}]"),
        ("mean", 150, "kodex", "ngf", "of NGF by {} [{}, {}]"),
        ("door", 10, "regression", "kodex", "behind Regression by {} [{}, {}]"),
        ("door", 10, "nearest", "kodex", "Nearest by {} [{}, {}]"),
        ("door", 10, "ndp", "kodex", "NDP by {} [{}, {}]"),
        ("relocation", 10, "regression", "kodex", "behind Regression by {} [{}, {}]"),
        ("relocation", 10, "ndp", "kodex", "NDP by {} [{}, {}]"),
        ("relocation", 10, "nearest", "kodex", "Nearest by {} [{}, {}]"),
    ):
        ahead = (by_seed[task, given][better] - by_seed[task, given][worse]).dropna()
        low, high = ttest_1samp(ahead, 0).confidence_interval()
        assert said.format(*(f"{one:.1f}" for one in (ahead.mean(), low, high))) in TEXT
    means = by_seed.groupby(["method", "task", "given"]).mean()
    of_paper = [means[method, "mean"] for method in ("nn", "lstm", "ndp", "ngf")]
    best = pd.concat(of_paper, axis=1).max(axis=1)
    assert (means["kodex", "mean"] > best).loc[:50].all()
    assert (means["regression", "mean"] > means["kodex", "mean"]).all()
    shown = table("## Few demonstrations")
    assert len(shown) == 7
    for method, cells in shown.items():
        for task, cell in zip((*TASKS, "mean"), cells, strict=True):
            found = means[method, task].sort_index()
            assert list(found.index) == [10, 25, 50, 100, 150, 200]
            assert cell == ", ".join(f"{one:.1f}" for one in found), (method, task)


def test_success_in_changed_physics():
    rows = widest(EVERYTHING.query("physics != 'nominal'"), "controller")
    by = [rows["method"], rows["task"], rows["physics"], rows["controller"]]
    means = rates(rows).groupby(by).mean()
    variations = ("heavy_object", "light_object", "light_hand", "heavy_hand")
    shown = table("## Changed physics")
    assert len(shown) == 11
    for method, cells in shown.items():
        controllers = ("none",) if method in ACTING else ("original", "tuned")
        for task, cell in zip(TASKS, cells, strict=True):
            found = [[f"{means[method, task, v, c]:.0f}" for c in controllers] for v in variations]
            assert cell == ", ".join(map("/".join, found)), (method, task)
    learnt = means.drop([*ACTING]).groupby("method").mean()
    sentence = TEXT.split("both controllers ")[1][:150]
    said = re.findall(r"(\w+)(?: has)? (\d\d\.\d)%", sentence)
    assert len(said) == len(learnt)
    for name, value in said:
        assert float(value) == pytest.approx(learnt[name.lower()], abs=0.05 + 1e-9)


@pytest.mark.parametrize(
    ("split", "pairs"), [("test", {"first": 0, "second": 17}), ("ood", {"first": 11, "second": 11})]
)
def test_pairs_told_apart_under_each_expert(split, pairs):
    rows = by_expert(Results(shipped()), split).query("method != 'expert'")
    assert {name: told_apart(part) for name, part in rows.groupby("expert")} == pairs
    assert "17 pairs of 84, and none with the first" in TEXT
    assert "there are 11 pairs with either" in TEXT


def told_apart(rows: pd.DataFrame) -> int:
    """How many pairs of methods of a task share no letter."""
    letters = [part["letters"] for _, part in rows.groupby("column")]
    return sum(not {*one} & {*other} for part in letters for one, other in combinations(part, 2))
