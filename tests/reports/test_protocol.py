"""Rows with different protocols are refused, others are not."""

from dataclasses import asdict, replace
from pathlib import Path

import pandas as pd
import pytest

from bench.experiments import cells_of
from bench.packed import SHIPPED as REFERENCE
from bench.presets import get_preset
from methods import registry
from reports.mixed import SHIPPED, MixedProtocols
from reports.protocol import differences
from reports.remarks import remarks_on_the_expert
from reports.results import Results
from tasks.pins import PINNED, UNPINNED

CONTROLLERS = {}
"""Fields of the controllers that `rows` has met, by key."""


def rows(preset, demos_key="key", **values):
    """Returns the rows of a preset on Door."""
    study = replace(get_preset(preset), **{"tasks": ("door",), "seeds": (1, 2, 3), **values})
    found = []
    for cell in cells_of(study, dict.fromkeys(study.tasks, demos_key)):
        if cell.controller:
            CONTROLLERS[cell.controller.key] = asdict(cell.controller)
        one = asdict(cell.fit) | asdict(cell.evaluation)
        found.append(one | {"episodes": cell.episodes})
    frame = pd.DataFrame(found)
    # Presets learn from the expert's demonstrations.
    return frame.assign(demos_key=frame.demos_key.where(frame.method != "expert", "key"))


def differing(*parts):
    return differences(pd.concat(parts, ignore_index=True), CONTROLLERS.__getitem__)


def refusal(*parts, shipped=(), notes=()):
    together = pd.concat(parts, ignore_index=True)
    found = differences(together, CONTROLLERS.__getitem__)
    return str(MixedProtocols(found, Path("results/mine"), shipped, notes).error(together))


def test_shipped_results_can_be_compared():
    results = Results(REFERENCE)
    assert differences(results.frame, results.controller_spec).empty


@pytest.mark.parametrize("preset", ["smoke", "quick", "paper"])
def test_methods_of_one_run_can_be_compared(preset):
    assert differing(rows(preset)).empty


def test_smoke_run_cannot_be_compared_with_the_shipped_results():
    message = refusal(
        rows("smoke", methods=("kodex", "nn"), episodes={"success": 20}),
        rows("paper", methods=("ndp", "ngf")),
        shipped=("ndp", "ngf"),
    )
    assert message.splitlines() == [
        "results/mine and the shipped results cannot be compared on door",
        "                      results/mine   shipped",
        "  demos                         10       200",
        "  controller epochs              5       300",
        "  share of epochs               2%      100%",
        "to show them nevertheless, give --mixed",
        "get comparable rows: bench run paper --experiments success --tasks door"
        " --methods kodex,nn --out results/mine-paper",
    ]


@pytest.mark.parametrize(("theirs", "switch"), [(UNPINNED, "off"), (PINNED, "on")])
def test_error_says_that_kernels_differ_and_not_what_they_recorded(theirs, switch):
    mine = {PINNED: UNPINNED, UNPINNED: PINNED}[theirs]
    own = rows("paper", methods=("kodex",), expert=True, episodes={"success": 20})
    shipped = rows("paper", "other", methods=("nn",), episodes={"success": 20})
    shipped = shipped[shipped.method == "nn"].assign(pins=theirs)
    message = refusal(own.assign(pins=mine), shipped, shipped=("nn",))
    first, heads, *settings, mixed, command = message.splitlines()
    assert first == "results/mine and the shipped results cannot be compared on door"
    assert heads.split() == ["results/mine", "shipped"]
    assert [line.split() for line in settings] == [["kernels", mine, theirs]]
    assert mixed == "to show them nevertheless, give --mixed"
    assert f"rows: BENCH_PINS={switch} bench run paper" in command
    together = pd.concat([own.assign(pins=mine), shipped], ignore_index=True)
    assert remarks_on_the_expert(together) == []


def test_error_names_two_methods_of_one_folder():
    message = refusal(rows("smoke", methods=("kodex",)), rows("paper", methods=("nn",)))
    first, heads, *_ = message.splitlines()
    assert first == "kodex and nn cannot be compared on door"
    assert heads.split() == ["kodex", "nn"]
    assert message.endswith("--methods kodex,nn --out results/mine-paper")


def test_method_with_two_protocols_is_refused():
    message = refusal(
        rows("smoke", methods=("kodex",), episodes={"ood": 20}),
        rows("paper", methods=("kodex",), episodes={"success": 20}),
    )
    assert message.startswith("kodex cannot be compared on door")
    assert message.splitlines()[2].split() == ["demos", "10,", "200"]
    assert "--experiments success,ood" in message


def test_demonstrations_of_a_file_cannot_be_compared_with_the_experts():
    message = refusal(
        rows("quick", "3f2a91c0 and more", methods=("kodex",)), rows("quick", methods=("nn",))
    )
    assert message.splitlines()[1:3] == [
        "                kodex           nn",
        "  demos of   3f2a91c0   the expert",
    ]


def test_command_includes_shipped_methods_whose_demonstrations_cannot_be_made_here():
    mine = rows("paper", methods=("kodex",))
    theirs = rows("paper", "of another MuJoCo", methods=("nn",))
    message = refusal(mine, theirs[theirs.method != "expert"], shipped=("nn",))
    assert "of anot" in message
    assert message.endswith("--methods kodex,nn --out results/mine-paper")


@pytest.mark.parametrize(
    ("settings", "refused"),
    [
        ({}, False),
        ({("nn", "epochs"): 100}, False),
        ({("nn", "epochs"): 2000}, True),
        ({("nn", "learning_rate"): 1e-2}, False),
    ],
)
def test_epochs_are_compared_as_a_share_of_each_methods_own(settings, refused):
    methods, episodes = ("nn", "ndp", "ngf"), {"success": 20}
    found = differing(rows("paper", methods=methods, episodes=episodes, settings=settings))
    assert (set(found.setting) == {"share of epochs"}) == refused
    assert set(found[found.method == "nn"].value) == ({"2000%"} if refused else set())


def test_shares_of_epochs_are_told_apart_despite_rounding():
    parts = [
        rows("quick", methods=("nn", "ngf"), epochs_share=0.1),
        rows("paper", methods=("ndp", "lstm")),
    ]
    found = differing(*parts).set_index("method").value
    assert found.to_dict() == {"nn": "10%", "ngf": "10%", "ndp": "100%", "lstm": "100%"}


def test_method_that_is_not_installed_has_no_share_of_epochs():
    gone = rows("quick", methods=("nn",)).replace({"method": {"nn": "gone"}})
    assert differing(gone, rows("paper", methods=("ndp",))).empty


def test_demonstrations_of_efficiency_and_controllers_of_audit_may_differ():
    experiments = {"success": 20, "efficiency": 20, "controllers": 20, "robustness": 20}
    assert differing(rows("paper", methods=("kodex", "ngf"), episodes=experiments)).empty


def test_controllers_of_the_same_name_are_compared():
    tuned = get_preset("paper").controller
    other = replace(tuned, learning_rate=1e-3, hidden=(2,))
    found = differing(
        rows("paper", methods=("kodex",)), rows("paper", methods=("nn",), controller=other)
    )
    assert set(found.setting) == {"controller hidden", "controller learning rate"}


def test_closed_loop_method_has_no_controller_to_compare():
    own = rows("smoke", methods=("kodex",), demos=200).assign(
        method="own", controller="none", controller_key=""
    )
    assert differing(own, rows("paper", methods=("nn",))).empty


def test_mixed_results_mark_the_smaller_group_and_say_what_differs():
    frame = pd.concat([rows("smoke", methods=("kodex",)), rows("quick", methods=("nn", "ndp"))])
    unlike = MixedProtocols(differences(frame, CONTROLLERS.__getitem__), Path("results"))
    assert unlike.marked == {"kodex"}
    assert unlike.notes == [
        "Rows that cannot be compared stand beside each other on Door: kodex (demos 10, controller"
        " epochs 5); nn, ndp (demos 200, controller epochs 300). An asterisk marks the methods"
        " that were run differently."
    ]
    frame = frame[frame.method != "ndp"]
    unlike = MixedProtocols(differences(frame, CONTROLLERS.__getitem__), Path("results"))
    assert unlike.marked == {"kodex"}
    assert SHIPPED not in unlike.notes[0]


def test_mixed_results_mark_methods_that_differ_from_the_shipped():
    frame = pd.concat([rows("smoke", methods=("kodex", "nn")), rows("paper", methods=("ndp",))])
    found = differences(frame, CONTROLLERS.__getitem__)
    assert MixedProtocols(found, Path("results"), ("ndp",)).marked == {"kodex", "nn"}
    assert MixedProtocols(found, Path("results")).marked == {"ndp"}


def test_method_that_cannot_be_imported_has_no_share_of_epochs(monkeypatch):
    def broken(name, variant):
        raise registry.InputError("cannot be imported")

    frame = pd.concat([rows("quick", methods=("nn",)), rows("paper", methods=("ndp",))])
    monkeypatch.setattr(registry, "get_method", broken)
    assert differing(frame).empty


@pytest.mark.parametrize(
    ("seeds", "others", "refused"),
    [((1,), (1,), False), ((1,), (1, 2), True), ((1, 2, 3), (2, 3, 4), False), ((1,), (2,), True)],
)
def test_seeds_must_be_equal_or_have_two_in_common(seeds, others, refused):
    found = differing(
        rows("paper", methods=("kodex", "nn"), seeds=seeds),
        rows("paper", methods=("ndp",), seeds=others),
    )
    assert set(found.setting) == ({"seeds"} if refused else set())
    assert set(found.method) == ({"kodex", "nn", "ndp"} if refused else set())


@pytest.mark.parametrize(
    ("preset", "values", "command"),
    [
        ("smoke", {}, "smoke --seeds 2 --tasks door --methods nn,expert --out results/mine"),
        ("quick", {}, "quick --seeds 2 --tasks door --methods nn,expert --out results/mine"),
        (
            "paper",
            {"episodes": {"success": 50, "ood": 50}},
            "paper --experiments success,ood --episodes 50 --seeds 2 --tasks door"
            " --methods nn,expert --out results/mine",
        ),
        (
            "quick",
            {"settings": {("nn", "learning_rate"): 1e-2}},
            "quick --seeds 2 --tasks door --methods nn,expert --out results/mine,"
            " with --set as before",
        ),
    ],
)
def test_error_says_how_the_folder_gets_the_seeds_that_it_lacks(preset, values, command):
    note, other = get_preset(preset).note, {k: v for k, v in values.items() if k != "settings"}
    message = refusal(
        rows(preset, methods=("kodex",), seeds=(1, 2), expert=False, **other),
        rows(preset, methods=("nn",), seeds=(1,), **other | values),
        notes=(note,),
    )
    assert message.endswith(f"get comparable rows: bench run {command}")


@pytest.mark.parametrize(("seed", "seeds"), [(1, "2"), (3, "1,3")])
def test_seeds_to_add_are_those_of_the_shipped_methods(seed, seeds):
    episodes = {"success": 1000}
    mine = rows("paper", methods=("kodex",), seeds=(seed,), episodes=episodes, expert=False)
    shipped = rows("paper", methods=("nn",), episodes=episodes)
    message = refusal(mine, shipped, shipped=("nn", "expert"))
    assert message.endswith(
        f"bench run paper --experiments success --seeds {seeds} --tasks door --methods kodex"
        " --out results/mine"
    )


def test_error_shows_the_differences_on_each_task():
    parts = [rows("smoke", methods=("kodex",), tasks=(task,)) for task in ("door", "tool")]
    others = [
        rows("paper", methods=("nn",)),
        rows("paper", methods=("nn",), demos=50, tasks=("tool",)),
    ]
    message = refusal(*parts, *others)
    assert "cannot be compared on door\n" in message
    assert "cannot be compared on tool\n" in message
    assert ["demos", "10", "200"] in [line.split() for line in message.splitlines()]
    assert ["demos", "10", "50"] in [line.split() for line in message.splitlines()]
    assert message.endswith("--tasks tool,door --methods kodex,nn --out results/mine-paper")


def test_methods_with_one_seed_in_one_condition_are_refused_whatever_they_have_in_others():
    """As in a run that has been interrupted."""
    methods = {"methods": ("kodex", "nn"), "episodes": {"success": 20, "ood": 20}}
    whole = rows("paper", **methods)
    late = (whole.method == "nn") & (whole.split == "test") & (whole.seed > 1)
    found = differing(whole[~late])
    assert set(found.setting) == {"seeds"}
    assert found.groupby("method").value.agg(set).to_dict() == {"kodex": {"1 2 3"}, "nn": {"1"}}
    assert differing(whole[~(late & (whole.seed > 2))]).empty
