"""Studies of methods that the second expert of a task taught, on small random experts."""

import pytest

import bench as suite
from bench.controller import ControllerConfig
from bench.controller_kinds import TUNED
from bench.results import Results as Stored
from bench.spec import ControllerSpec
from bench.studies import study_of
from bench.training_data import controller_demos
from methods.kodex import Kodex
from reports.exhibits import expert_change, two_experts
from reports.results import Results
from tasks.demos import demos_key, load_demos, split
from tasks.errors import InputError
from tasks.experts import experts_of, load_expert
from tasks.recorder import record

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)
RUN = ("run", "smoke", "--jobs", "1", "--experiments", "success,ood")


@pytest.fixture
def run(task, two_shipped, smoke, bench, tmp_path):
    """Runs `smoke` with each expert named; returns the results folder."""

    def of_experts(*names, folder="results", seeds="1", options=()):
        out = tmp_path / folder
        for name in names:
            of_one = ("--expert", name, "--seeds", seeds, "--out", str(out))
            code, _, err = bench(*RUN, *of_one, *options)
            assert code == 0, err
        return out

    return of_experts


def test_a_task_names_its_experts(task, shipped, bench):
    assert experts_of(task) == ("first",)
    code, out, err = bench(*RUN, "--expert", "second", "--out", "results")
    assert (code, out) == (2, "")
    assert "unknown expert of door 'second'" in err


def test_an_unknown_expert_is_refused_with_the_nearest_name(task, two_shipped, bench):
    code, _, err = bench(*RUN, "--expert", "secnd", "--out", "results")
    assert code == 2
    assert "did you mean 'second'" in err


def test_methods_learn_from_the_expert_named(task, run):
    out = run("second")
    assert set(Stored(out).frame().expert) == {"second"}
    fitted = suite.open(out).methods("door", seed=1)["kodex"]
    again = Kodex(fitted.config, task.layout)
    again.fit(*split(load_demos(task, 1, "second")), 1)
    for name, values in again.parameters().items():
        assert (values == fitted.parameters()[name]).all(), name


def test_tuned_controllers_learn_from_new_rollouts_of_the_expert_named(task, two_shipped):
    key = demos_key(task, "second")
    spec = ControllerSpec("door", TUNED, ControllerConfig(), 3, key, 1, physics="heavy_hand")
    actions = load_expert(task, "second").policy
    recorded = record(task, task.sample("demo", 3, 1), actions, "heavy_hand", failures=True)[1]
    assert (controller_demos(spec).actions == recorded.actions).all()


def test_what_two_experts_taught_has_different_keys_and_one_folder_shows_the_first(task, run):
    out = run("first", "second")
    frame = Stored(out).frame()
    assert len(frame) == 2 * len(Results(out).frame)
    assert frame.groupby("expert").folder.nunique().eq(2).all()
    assert frame.groupby("expert").demos_key.nunique().eq(1).all()
    assert frame[frame.method == "kodex"].controller_key.nunique() == 2
    shown = Results(out)
    assert (shown.experts, set(shown.frame.expert)) == (["first", "second"], {"first"})
    assert set(Results(out, expert="second").frame.expert) == {"second"}


def test_a_label_tells_what_the_second_expert_taught(task, run):
    out = run("first", "second")
    names = set(suite.load(out).method)
    assert names == {"expert", "kodex", "expert:second_expert", "kodex:second_expert"}
    assert set(suite.load(run("second", folder="alone")).method) == {"expert", "kodex"}


def test_the_exhibit_has_a_row_for_each_method_under_each_expert(task, run):
    table = two_experts.by_expert(Results(run("first", "second")), "test")
    assert table.row.tolist() == ["expert first", "expert second", "kodex first", "kodex second"]
    assert two_experts.EXHIBITS[0].draw(table).axes
    alone = Results(run("second", folder="alone"))
    assert two_experts.by_expert(alone, "test").empty
    assert expert_change.table(alone, "test").empty


def test_the_change_is_the_second_experts_success_minus_the_firsts(task, run):
    out = run("first", "second", seeds="2")
    rates = two_experts.by_expert(Results(out), "test").set_index("row").value
    table = expert_change.table(Results(out), "test").set_index("row")
    assert [*table.index] == ["expert", "kodex"]
    for method, row in table.iterrows():
        assert row.value == pytest.approx(rates[f"{method} second"] - rates[f"{method} first"])
        assert row.low <= row.value <= row.high
    assert expert_change.table(Results(run("first", "second", folder="single")), "test").empty


def test_each_method_has_one_size_under_both_experts(task, run):
    of_nn = ("--methods", "nn,kodex", "--sizes")
    out = run("first", options=(*of_nn, "median"))
    run("second", options=(*of_nn, "small"))
    assert set(two_experts.of_both(Results(out), "test").method) == {"kodex"}
    run("second", options=(*of_nn, "median"))
    rows = two_experts.of_both(Results(out), "test").query("method == 'nn'")
    assert rows[["expert", "size"]].values.tolist() == [["first", "median"], ["second", "median"]]


def test_the_first_lines_of_a_report_name_the_second_expert(task, run, bench, tmp_path):
    out = run("second")
    code, _, err = bench("report", str(out), "--out", str(tmp_path / "page"))
    assert code == 0, err
    assert "second expert" in (tmp_path / "page" / "index.html").read_text()


def test_files_of_demonstrations_and_the_second_expert_exclude_each_other(task, two_shipped):
    with pytest.raises(InputError, match="not from both"):
        study_of("smoke", expert="second", demos="mine.safetensors")


def test_the_second_expert_acts_otherwise(task, two_shipped, bench):
    assert load_expert(task).identity != load_expert(task, "second").identity
    code, out, _ = bench("expert", "evaluate", "door", "--expert", "second", "--episodes", "3")
    assert code == 0
    assert "door/probe, second expert" in out
