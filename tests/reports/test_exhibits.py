"""Every exhibit, for made-up results of every experiment."""

from copy import copy
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb

from bench.experiments import cells_of
from bench.names import CONDITIONS
from bench.presets import get_preset
from methods.nn import NN
from methods.registry import SUITE
from reports import write
from reports.exhibit import Exhibit
from reports.exhibits import EXHIBITS
from reports.exhibits.starts import OUTCOMES
from reports.results import Results
from reports.rows import Rows
from reports.seed_statistics import ONE_SEED, OVER_SEEDS
from reports.style import colour
from reports.write import write_report
from tasks.data import generator
from tasks.disturbances import TOGETHER, UNDISTURBED
from tasks.registry import EXPERTS, TASKS, get_task

NEEDS_FITS = "motions"
"""The exhibit that is empty for results without fits."""


BY_NAME = {exhibit.name: exhibit for exhibit in EXHIBITS}
TABLE_1, TABLE_2, TABLE_6, FIGURE_7 = (
    BY_NAME[name] for name in ("table_1", "table_2", "table_6", "figure_7")
)


def rate(fit):
    return generator("rate", fit).random()


def place_of(row):
    return tuple(row[name] for name in ("folder", *CONDITIONS))


class MadeUp(Results):
    """Results of the presets `paper`, `audit` and `beyond` with random successes."""

    frame = pd.DataFrame()
    notes = ("made up",)
    provenance = ()
    source = None
    """It has no fits."""
    finished = ()
    folder = Path("made up")
    experts = EXPERTS

    def __init__(self):
        rng = generator("made up")
        audit, beyond, paper = map(get_preset, ("audit", "beyond", "paper"))
        studies = [replace(study, seeds=(1, 2)) for study in (audit, beyond, paper)]
        cells = [cell for study in studies for cell in cells_of(study, dict.fromkeys(TASKS, "key"))]
        rows = []
        for cell in {(cell.fit.key, cell.evaluation.name): cell for cell in cells}.values():
            counts = {
                "episodes": cell.episodes,
                "successes": int(cell.episodes * rate(cell.fit.label)),
                "fit_seconds": 10 * rng.random(),
                "action_seconds": rng.random() / 1000,
                "folder": cell.fit.label,
            }
            rows.append(asdict(cell.fit) | asdict(cell.evaluation) | counts)
        self.frame = pd.DataFrame(rows)
        self.stored = {place_of(row): row["episodes"] for row in rows}

    def taught_by(self, expert):
        taught = copy(self)
        taught.frame = self.frame.assign(expert=expert)
        taught.rows = Rows(taught.frame)
        return taught

    def outcomes(self, row):
        count = self.stored.get(place_of(row), row["episodes"])
        success = np.diff(np.floor(np.arange(count + 1) * rate(row["folder"]))) > 0
        steps = get_task(row["task"]).steps
        start = np.arange(len(success))
        return pd.DataFrame(
            {"start": start, "success": success, "diverged": ~success & False, "steps": steps}
        )

    def readings(self, row):
        success = self.outcomes(row).success.to_numpy()
        end = np.where(success, 0.0 if row["task"] == "tool" else 2.0, 1.0)
        return np.repeat(end[:, None], get_task(row["task"]).steps, axis=1).astype(np.float32)

    def controller_spec(self, key):
        return {"config": {"learning_rate": 1e-4, "epochs": 300}}

    def diagnostics(self, folder):
        rng = generator(folder)
        eigenvalues = 0.7 * rng.standard_normal((500, 2))
        return {
            "eigenvalues": eigenvalues,
            "imitation_error": rng.random(24),
            "singular_values": np.logspace(0, -17, 500),
            "rank": np.array(400),
        }


@pytest.fixture(scope="module")
def results():
    return MadeUp()


@pytest.mark.parametrize("exhibit", EXHIBITS, ids=lambda exhibit: exhibit.name)
def test_exhibit_has_a_complete_table_and_a_caption(exhibit: Exhibit, results):
    table = exhibit.table(results)
    assert {"row", "column", "value"} <= set(table.columns)
    if exhibit.name == NEEDS_FITS:
        assert table.empty
        return
    read = exhibit.summary(table) if exhibit.summary else table
    assert not read.duplicated(["row", "column"]).any()
    wide = exhibit.wide(table)
    assert len(wide) == read.row.nunique()
    # There is no tuned controller for nominal physics, and the expert has none.
    wide = wide.drop(columns=["nominal", "Expert"], errors="ignore")
    # The door cannot be moved.
    wide = wide[~wide[""].str.contains(" object (?:off|push) ")]
    assert not wide.isin(["-"]).any(axis=None)
    assert exhibit.caption(table).endswith(".")


EXPECTED = {
    "success": (8, 4),
    "all_tasks": (8, 4),
    "table_1": (1, 4),
    "table_2": (3, 4),
    "table_5": (3, 4),
    "figure_5": (8, 4),
    "table_11": (4, 4),
    "table_12": (1, 4),
    "rank": (4, 4),
    "figure_6": (8, 4),
    "figure_6_time": (4, 4),
    "efficiency": (7 * 6, 4),
    "efficiency_time": (7 * 6, 4),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_exhibit_has_as_many_rows_and_columns_as_in_the_paper(name, results):
    table = BY_NAME[name].table(results)
    assert (table.row.nunique(), table.column.nunique()) == EXPECTED[name]


@pytest.mark.parametrize("number", [7, 8, 9, 10])
def test_robustness_has_the_papers_rows_and_numbers_and_a_nominal_column(number, results):
    table = BY_NAME[f"table_{number}"].table(results)
    methods = ["kodex", "nn", "lstm", "ndp", "ngf", "nearest", "regression"]
    rows = ["expert", *(f"{m} original" for m in methods), *(f"{m} tuned" for m in methods)]
    assert table.row.drop_duplicates().tolist() == rows
    assert table.column.drop_duplicates().tolist()[0] == "nominal"
    nominal = table[table.column == "nominal"].set_index("row").value
    fits = results.rows.main(task=TASKS[number - 7], split="test", method="nn").folder
    shares = [int(200 * rate(fit)) / 2 for fit in fits]
    assert nominal["nn original"] == pytest.approx(np.mean(shares))
    assert set(table.n) == {200}
    beside = table[table.column != "nominal"].published.notna().sum()
    assert beside == (40 if number == 7 else 44)


def test_methods_beyond_the_paper_are_compared_with_one_controller(results):
    for name in ("beyond_conditions", "closed_loop"):
        seeds = BY_NAME[name].table(results).seeds
        assert set(seeds) == {2}, name


def test_a_task_of_a_package_leaves_success_over_all_tasks_as_it_is(results):
    more, table = MadeUp(), BY_NAME["all_tasks"].table
    press = results.frame[results.frame.task == "door"].assign(task="press")
    more.frame = pd.concat([results.frame, press], ignore_index=True)
    pd.testing.assert_frame_equal(table(more), table(results))


def test_intervals_contain_the_value_and_spreads_are_over_seeds(results):
    table = BY_NAME["success"].table(results)
    assert ((table.low <= table.value) & (table.value <= table.high)).all()
    assert table.spread.notna().all()
    nn = results.rows.main(split="test", method="nn", task="door")
    expected = np.std(100 * nn.successes / nn.episodes, ddof=1)
    row = table[(table.row == "nn") & (table.column == "door")].iloc[0]
    assert (row.spread, row.seeds, row.n) == (pytest.approx(expected), 2, 1000)


def test_sizes_use_the_fits_on_the_most_demonstrations_of_each_task(results):
    some = MadeUp()
    fewer = results.frame.demos.where(results.frame.task != "door", 100)
    some.frame = results.frame.assign(demos=fewer)
    table = TABLE_2.table(some)
    assert table.groupby("column").size().to_dict() == dict.fromkeys(TASKS, 3)


def test_figure_7_counts_every_eigenvalue(results):
    counts = FIGURE_7.table(results).pivot(index="row", columns="column", values="value")
    assert counts.sum().tolist() == pytest.approx([500] * 4)
    assert (counts.loc["1.05 and above"] > 100).all()


class TestTable6:
    def test_values_are_those_of_the_stored_controllers(self, results, monkeypatch):
        config = {"learning_rate": 2e-4, "epochs": 5}
        monkeypatch.setattr(results, "controller_spec", lambda key: {"config": config})
        wide = TABLE_6.wide(TABLE_6.table(results)).to_numpy().tolist()
        assert wide == [["controller", "0.0002 (0.0001)", "5 (300)"]]

    def test_each_set_of_values_has_a_row_that_names_its_tasks(self, results, monkeypatch):
        frame = results.frame
        tool = set(frame[frame.task == "tool"].controller_key)

        def spec(key):
            return {"config": {"learning_rate": 1e-4, "epochs": 5 if key in tool else 300}}

        monkeypatch.setattr(results, "controller_spec", spec)
        iterations = TABLE_6.table(results).pivot(index="row", columns="column", values="value")
        assert iterations.iterations.to_dict() == {
            "controller 1: tool": 5,
            "controller 2: door, relocation, reorientation": 300,
        }


def test_caption_says_what_intervals_speak_of_and_single_seeds_are_marked():
    table = pd.DataFrame({"row": ["kodex", "nn"], "column": "door", "value": [50.0, 60.0]})
    table = table.assign(low=40.0, high=70.0, seeds=[10, 1], n=[1000, 200])
    mixed = table.assign(basis=[OVER_SEEDS, ONE_SEED])
    caption = TABLE_1.caption(mixed)
    assert "1 to 10 seeds, each with 200 to 1,000 starts of its own." in caption
    assert "95% intervals over seeds (Student's t)" in caption
    assert "not over experts" in caption
    assert (
        "† One seed: the 95% interval (Wilson's) speaks of this fit and this controller only"
        in caption
    )
    texts = TABLE_1.wide(mixed).Door.tolist()
    assert texts == ["50.0 [40.0, 70.0]", "60.0 [40.0, 70.0]†"]
    assert "†" not in TABLE_1.caption(table.assign(basis=OVER_SEEDS))


@pytest.mark.parametrize("name", ["success", "efficiency", "figure_6"])
def test_intervals_of_single_seeds_are_dotted_in_figures(name, results):
    one = MadeUp()
    one.frame = results.frame[results.frame.seed == 1]
    dotted, solid = (
        lines_of_intervals(BY_NAME[name].draw(BY_NAME[name].table(some))) for some in (one, results)
    )
    assert all(dashes is not None for dashes in dotted)
    assert all(dashes is None for dashes in solid)


def lines_of_intervals(drawing):
    """The dashes of each interval; None is a solid line."""
    found = [
        dashes
        for axes in drawing.axes
        for lines in axes.collections
        if isinstance(lines, LineCollection)
        for _, dashes in lines.get_linestyle()
    ]
    assert found
    return found


def test_report_writes_each_exhibit(results, tmp_path, monkeypatch):
    """Each format is drawn from the shipped results."""
    monkeypatch.setattr(write, "_DATED", {"svg": ("Date",)})
    made = write_report(results, tmp_path)
    shown = [exhibit for exhibit in EXHIBITS if exhibit.name != NEEDS_FITS]
    assert (len(made.written), made.failed) == (len(shown), {})
    for exhibit in shown:
        for ending in ("csv", "md", "tex"):
            assert (tmp_path / f"tables/{exhibit.name}.{ending}").stat().st_size
    claims = (tmp_path / "tables/claims.md").read_text()
    assert "On Relocation, KODex does marginally better with set 2 than with set 3" in claims
    drawn = {exhibit.name for exhibit in shown if exhibit.axis}
    assert {path.stem for path in (tmp_path / "figures").iterdir()} == drawn


def test_rows_that_are_compared_have_one_size_even_if_studies_had_two(results):
    """A study with `sizes` evaluated other sizes from test starts than one with the default."""
    two = copy(results)
    frame = results.frame.assign(
        size=results.frame["size"].where(results.frame.method != "nn", "median")
    )
    changed = (frame.method == "nn") & (frame.split == "test")
    plain = changed & (frame.disturbance == UNDISTURBED) & (frame.physics == "nominal")
    plain &= (frame.replan == 0) & (frame.rule == "appendix") & (frame.variant == "described")
    chosen = frame[plain].assign(size="large", folder="large " + frame.folder)
    validated = frame[(frame.method == "nn") & (frame.split == "validation")]
    two.frame = pd.concat(
        [frame, chosen, validated.assign(size="large", successes=validated.episodes)]
    )
    two.rows = Rows(two.frame)
    parts = two.rows.at_one_size(
        [two.rows.every(split="test", disturbance=name) for name in (UNDISTURBED, "late_1")]
    )
    for part in parts:
        assert set(part[part.method == "nn"]["size"]) == {"median"}
    assert set(two.rows.main(method="nn", split="test")["size"]) == {"large"}
    nn = BY_NAME["audit_rule"].table(two).query("row == 'nn'")
    assert set(nn.column) == {
        "tool appendix",
        "tool published",
        *(f"reorientation {r}" for r in ("appendix", "published")),
    }


def test_efficiency_of_one_task_hides_neither_others_times_nor_shows_them_with_one_count(results):
    part, frame = copy(results), results.frame
    few = (frame.held_out > 0) | (frame.demos < 200)
    part.frame = frame[~few | (frame.task == "door")]
    part.frame = part.frame.assign(fit_seconds=part.frame.fit_seconds.where(~few))
    part.rows = Rows(part.frame)
    shown = BY_NAME["efficiency"].table(part)
    assert set(shown.column) == {"door"}
    assert {"nn 10", "nn 200"} <= {*shown.row}
    timed = BY_NAME["efficiency_time"].table(part)
    assert {"kodex 200", "nn 200", "regression 200"} <= {*timed.row}
    assert set(timed.demos) == {200}
    assert list(timed.column.unique()) == list(TASKS)


def test_report_omits_exhibits_without_results(results, tmp_path):
    some = MadeUp()
    some.frame = results.frame[
        (results.frame.split == "validation") & (results.frame.method == "kodex")
    ]
    some.frame = some.frame[some.frame.variant == "described"]
    names = {path.stem for path in write_report(some, tmp_path).written}
    of_kodex = {"table_11", "table_12", "rank", "figure_6_time", "figure_7"}
    assert names == {"table_1", "table_6", *of_kodex}
    assert TABLE_1.table(some).published.tolist() == [100, 96, 88, 62]


def test_method_has_the_same_colour_in_every_figure():
    with_expert = ["expert", "kodex", "nn", "mine", "yours"]
    without = with_expert[1:]
    assert [colour(m, with_expert) for m in without] == [colour(m, without) for m in without]
    assert len({colour(m, with_expert) for m in with_expert}) == 5


def test_legend_shows_the_users_method_in_bold():
    table = pd.DataFrame({"row": ["kodex", "mine"], "column": "door", "value": 50.0})
    (legend,) = replace(TABLE_1, own=frozenset({"mine"})).draw(table).legends
    assert {text.get_text(): text.get_fontweight() for text in legend.get_texts()} == {
        "KODex": "normal",
        "mine": "bold",
    }


@pytest.mark.parametrize("name", ["table_12", "figure_6_time", "efficiency_time"])
def test_values_without_a_meaningful_zero_are_drawn_as_dots_on_a_fitted_axis(name, results):
    exhibit = BY_NAME[name]
    table = exhibit.table(results)
    if name == "efficiency_time":
        table = table[table.demos == 200]
    (axes,) = exhibit.draw(table).axes
    assert not axes.patches
    low, high = axes.get_ylim()
    assert 0 < low < table.value.min() <= table.value.max() < high


def test_training_times_are_dots_if_the_number_of_demonstrations_does_not_vary(results):
    exhibit = BY_NAME["efficiency_time"]
    table = exhibit.table(results)
    panel = exhibit.draw(table).axes[0]
    assert all(
        len(line.get_xdata()) > 1 for line in panel.get_lines() if line.get_label()[0] != "_"
    )
    one = exhibit.draw(table[table.demos == 200]).axes[0]
    assert [text.get_text() for text in one.get_xticklabels()] == [
        "Tool",
        "Door",
        "Relocation",
        "Reorientation",
    ]


@pytest.mark.parametrize("paper", ["#fdfdfc", "#17181a"], ids=["light", "dark"])
@pytest.mark.parametrize("outcome", OUTCOMES)
def test_starts_can_be_told_from_a_light_and_from_a_dark_page(paper, outcome):
    least = 2.2 if outcome == "success" else 3.0  # WCAG's for graphical objects
    light = [luminance(OUTCOMES[outcome]["color"]), luminance(paper)]
    assert (max(light) + 0.05) / (min(light) + 0.05) >= least


def luminance(colour):
    """The relative luminance of WCAG 2."""
    parts = np.array(to_rgb(colour))
    linear = np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


def share(results, **values):
    """Success [%] of each seed, in a loop over the rows with these values."""
    wanted = {"split": "test", "physics": "nominal", "rule": "appendix", "disturbance": "none"}
    wanted |= {"replan": 0, "variant": "described"} | values
    found = {}
    for row in results.frame.to_dict("records"):
        if row["controller"] in ("original", "none") and wanted.items() <= row.items():
            assert row["seed"] not in found
            found[row["seed"]] = 100 * results.outcomes(row).success.mean()
    return [found[seed] for seed in sorted(found)]


def value(table, row, column):
    (found,) = table[(table.row == row) & (table.column == column)].value
    return found


def test_numbers_of_exhibits_equal_those_of_a_loop(results):
    sizes = {"size": NN.default_size["door"]}
    table = BY_NAME["efficiency"].table(results)
    held_out = share(results, task="door", method="nn", demos=80, held_out=20, **sizes)
    assert value(table, "nn 100", "door") == pytest.approx(np.mean(held_out))
    whole = share(results, task="tool", method="kodex", demos=100, held_out=0)
    assert value(table, "kodex 100", "tool") == pytest.approx(np.mean(whole))

    by_task = [
        share(results, task=task, method="kodex", demos=200, held_out=0, episodes=1000)
        for task in TASKS
    ]
    middle = np.sort(np.transpose(by_task), axis=1)[:, 1:3].mean()
    table = BY_NAME["all_tasks"].table(results)
    (column,) = (c for c in table.column.unique() if c.startswith("test inter"))
    assert value(table, "kodex", column) == pytest.approx(middle)


def test_diagnostics_of_exhibits_equal_those_of_a_loop(results):
    fits = results.frame.query(
        "task == 'door' and method == 'kodex' and variant == 'described' and split == 'test'"
        " and demos == 200 and held_out == 0"
    ).drop_duplicates("folder")
    seen = [results.diagnostics(folder) for folder in fits.folder]
    values = [[complex(*pair) for pair in one["eigenvalues"]] for one in seen]
    constants = [min(each, key=lambda value: abs(value - 1)) for each in values]
    largest = [
        max(abs(value) for value in each if value != constant)
        for each, constant in zip(values, constants, strict=True)
    ]
    assert value(BY_NAME["table_12"].table(results), "kodex", "door") == pytest.approx(
        np.mean(largest)
    )
    errors = [one["imitation_error"].mean() for one in seen]
    table = BY_NAME["figure_6"].table(results)
    (row,) = (r for r in table.row.unique() if r.startswith("set 3") and "error" in r)
    assert value(table, row, "door") == pytest.approx(np.median(errors))
    assert value(BY_NAME["table_11"].table(results), "set 3", "door") == 499

    table = BY_NAME["times"].table(results)
    rows = results.frame.dropna(subset="action_seconds")
    rows = rows.query("split == 'test' and variant == 'described' and method == 'kodex'")
    firsts = [rows[rows.task == task].iloc[0] for task in TASKS]
    mean = np.mean([1000 * row.action_seconds for row in firsts])
    assert value(table, "kodex", "action [ms]") == pytest.approx(mean)


def test_a_report_shows_the_size_that_validation_starts_choose(results):
    validated = results.frame.query("split == 'validation' and method == 'nn' and task == 'door'")
    sizes = {
        size: (part.successes / part.episodes).mean() for size, part in validated.groupby("size")
    }
    best = max(sizes, key=sizes.get)
    more, shown = MadeUp(), results.rows.main(split="test", method="nn", task="door")
    parts = [shown.assign(size=size, successes=0 if size == best else 999) for size in sizes]
    others = more.frame.query("method != 'nn'")
    more.frame = pd.concat([others, validated, *parts], ignore_index=True)
    assert set(more.rows.main(split="test", method="nn", task="door")["size"]) == {best}


def test_methods_are_compared_with_the_expert_on_its_own_starts(results):
    table = BY_NAME["behind_expert"].table(results)
    assert len(table) == 4 * (len(SUITE) + 3 * 3)
    at = {"task": "door", "split": "test", "disturbance": TOGETHER}
    shown = table.set_index(["row", "column"]).value
    for row, method, replan in (("nn every_5", "nn", 5), ("flow", "flow", 0)):
        mine = results.rows.main(method=method, replan=replan, **at)
        experts = results.rows.main(method="expert", **at)
        rates = [results.episodes.rates(one, ["method"]).value[0] for one in (mine, experts)]
        assert shown[row, "door"] == pytest.approx(rates[0] - rates[1])


def test_points_of_replanning_stand_above_their_intervals():
    exhibit = BY_NAME["closed_loop"]
    values = {"once": 10.0, "every_1": 95.0, "every_20": 40.0, "every_5": 70.0}
    rows = [("mine", often, value) for often, value in values.items()]
    rows += [("kodex", often, values[often]) for often in ("every_1", "once")]
    table = pd.DataFrame(rows, columns=["method", "often", "value"]).assign(
        place="nominal", column="door", low=0.0, high=100.0
    )
    drawing = exhibit.draw(table.assign(row=table.method + " nominal " + table.often))
    (axes,) = drawing.axes
    ticks = [tick.get_text() for tick in axes.get_xticklabels()]
    assert ticks == ["once", "20", "5", "1"]
    drawn = {}
    for line in axes.get_lines():
        for x, y in line.get_xydata():
            drawn.setdefault(ticks[int(x)], set()).add(y)
    assert {name: drawn[name] for name in ticks} == {"once": {10}, "20": {40}, "5": {70}, "1": {95}}
