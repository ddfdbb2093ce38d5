"""The cells of experiments."""

from collections import Counter
from dataclasses import replace

import pytest

from bench import spec
from bench.controller_kinds import FINE_TUNED, ON_SUCCESSES, ORIGINAL, TUNED, UNCLIPPED
from bench.experiments import EXPERIMENTS, cells_of
from bench.presets import get_preset
from bench.study_demos import demos_keys_of
from tasks.disturbances import names_of
from tasks.errors import InputError
from tasks.masses import NOMINAL, READINGS, VARIATIONS
from tasks.registry import get_task

AUDIT = ("variants", "rules", "readings", "controllers")


def test_controllers_that_learn_from_the_expert_do_not_depend_on_files_of_demonstrations():
    study = replace(get_preset("paper"), tasks=("door",), methods=("kodex",))
    own, other = cells_of(study, demos_keys_of(study)), cells_of(study, {"door": "of a file"})
    assert len(own) == len(other)
    for mine, theirs in zip(own, other, strict=True):
        if mine.controller is not None:
            alike = mine.controller.kind != ORIGINAL
            assert (mine.controller == theirs.controller) == alike


def test_evaluations_after_a_file_of_demonstrations_depend_on_the_version_of_mujoco(monkeypatch):
    study = replace(get_preset("smoke"), methods=("kodex",))
    cells = cells_of(study, {"door": "of a file"})
    before = [(cell.fit.key, cell.evaluation.key(cell.fit)) for cell in cells]
    monkeypatch.setattr("mujoco.__version__", "9.9")
    for cell, (fit, evaluation) in zip(cells, before, strict=True):
        if cell.fit.method == "kodex":
            assert cell.fit.key == fit
            assert cell.evaluation.key(cell.fit) != evaluation


@pytest.mark.parametrize(
    ("place", "name", "value"),
    [
        (get_task("door"), "version", 99),
        (get_task("door"), "model_hash", "another"),
        (get_task("door"), "horizon", 50),
        (spec, "CHUNK", 7),
    ],
)
def test_an_evaluation_is_computed_anew_if_its_task_or_chunks_change(
    place, name, value, monkeypatch
):
    study = replace(get_preset("smoke"), methods=("kodex",))
    fit, evaluation = next(
        (cell.fit, cell.evaluation)
        for cell in cells_of(study, {"door": "of a file"})
        if cell.fit.method == "kodex"
    )
    before = evaluation.key(fit)
    monkeypatch.setattr(place, name, value)
    assert evaluation.key(fit) != before


def test_no_cell_appears_twice_and_methods_of_a_seed_share_the_expert():
    study = get_preset("paper")
    cells = cells_of(study, dict.fromkeys(study.tasks, "key"))
    places = [(cell.fit.key, cell.evaluation.name) for cell in cells]
    assert len(places) == len(set(places))
    experts = [cell for cell in cells if cell.fit.method == "expert"]
    assert len({cell.fit.key for cell in experts}) == len(study.tasks) * len(study.seeds)


def test_unknown_experiments_are_refused():
    with pytest.raises(InputError, match="did you mean 'success'"):
        cells_of(replace(get_preset("smoke"), episodes={"sucess": 1}), {"door": ""})


def test_a_study_with_nothing_to_evaluate_is_refused():
    study = replace(get_preset("paper"), episodes={"lifting": 5}, methods=("nn",), tasks=("door",))
    with pytest.raises(InputError, match="lifting: nothing to evaluate with nn"):
        cells_of(study, {"door": "key"})
    with pytest.raises(InputError, match="nothing to evaluate with nn and 5 demonstrations"):
        cells_of(replace(study, episodes={"efficiency": 5}, demos=5), {"door": "key"})


def test_robustness_evaluates_each_variation_with_the_original_and_the_tuned_controller():
    study = replace(get_preset("paper"), tasks=("tool",), seeds=(4,), episodes={"robustness": 200})
    cells = cells_of(study, {"tool": "key"})
    for_kodex = [cell for cell in cells if cell.fit.method == "kodex"]
    assert len(for_kodex) == 1 + 4 * 2
    tuned = {cell.controller.key for cell in for_kodex if cell.evaluation.controller == "tuned"}
    assert len(tuned) == 4
    assert sum(cell.fit.method == "expert" for cell in cells) == 5
    assert {cell.evaluation.split for cell in cells} == {"test"}


def test_the_paper_has_every_experiment_and_shares_cells():
    study = replace(get_preset("paper"), seeds=(1,))
    keys = dict.fromkeys(study.tasks, "key")
    assert {*EXPERIMENTS} - {*study.episodes} == {"disturbed", "closed_loop", *AUDIT}
    apart = sum(
        len(EXPERIMENTS[name](replace(study, demos_keys=keys), {})) for name in study.episodes
    )
    assert len(cells_of(study, keys)) < apart
    sets = {c.fit.variant for c in cells_of(study, keys) if c.fit.method == "kodex"}
    assert sets == {"described", "set_1", "set_2", "set_4"}


def test_audit_changes_one_of_physics_controller_and_rule_at_a_time():
    study = replace(get_preset("audit"), tasks=("tool",), seeds=(2,), methods=("kodex",))
    cells = cells_of(replace(study, episodes=dict.fromkeys(AUDIT, 5)), {"tool": "key"})
    tried = Counter(
        (cell.controller.kind, cell.evaluation.physics, cell.evaluation.rule)
        for cell in cells
        if cell.fit.method == "kodex" and cell.fit.variant == "described"
    )
    assert tried == Counter(
        [
            (ORIGINAL, NOMINAL, "appendix"),
            (ORIGINAL, NOMINAL, "published"),
            (UNCLIPPED, NOMINAL, "appendix"),
            *((ORIGINAL, physics, "appendix") for physics in READINGS["tool"]),
            *((ON_SUCCESSES, physics, "appendix") for physics in VARIATIONS),
            *((FINE_TUNED, physics, "appendix") for physics in VARIATIONS),
        ]
    )


def test_a_tuned_controller_learns_in_the_physics_of_the_evaluation_and_others_in_nominal():
    study = replace(get_preset("paper"), tasks=("door",), methods=("kodex",))
    controllers = [
        (cell.evaluation.physics, cell.controller)
        for cell in cells_of(study, {"door": "key"})
        if cell.controller
    ]
    assert controllers
    for physics, controller in controllers:
        tuned = controller.kind in (TUNED, ON_SUCCESSES, FINE_TUNED)
        assert controller.physics == (physics if tuned else NOMINAL)


def test_a_fine_tuned_controller_starts_from_the_original_one_of_its_seed_and_demonstrations():
    study = replace(get_preset("audit"), tasks=("door",), methods=("kodex",), demos_keys={})
    cells = cells_of(study, {"door": "of a file"})
    original = {
        cell.fit.seed: cell.controller
        for cell in cells
        if cell.controller and cell.controller.kind == ORIGINAL
    }
    tuned = [c for cell in cells if (c := cell.controller) and c.kind == FINE_TUNED]
    assert {controller.seed for controller in tuned} == {1, 2, 3}
    for controller in tuned:
        assert controller.start == original[controller.seed]
        assert controller.start.demos_key == "of a file" != controller.demos_key


def test_efficiency_trains_on_fewer_demonstrations_and_keeps_the_controller():
    study = replace(get_preset("paper"), tasks=("door",), methods=("kodex",), seeds=(1,))
    cells = cells_of(replace(study, episodes={"efficiency": 5}), {"door": "key"})
    assert [cell.fit.demos for cell in cells] == [10, 25, 50, 100, 150, 200]
    assert {cell.controller.demos for cell in cells} == {200}


def test_a_method_that_chooses_by_validation_holds_out_a_fifth_of_few_demonstrations():
    study = replace(get_preset("paper"), tasks=("door",), methods=("kodex", "nn"), seeds=(1,))
    cells = cells_of(replace(study, episodes={"efficiency": 5}), {"door": "key"})
    given = {"kodex": [], "nn": []}
    for cell in cells:
        given[cell.fit.method].append((cell.fit.demos, cell.fit.held_out))
    assert given["nn"] == [(8, 2), (20, 5), (40, 10), (80, 20), (120, 30), (160, 40)]
    assert given["kodex"] == [(count, 0) for count in (10, 25, 50, 100, 150, 200)]
    whole = cells_of(replace(study, episodes={"success": 5}), {"door": "key"})
    keys = [{cell.fit.key for cell in some if cell.fit.method == "nn"} for some in (whole, cells)]
    assert keys[0].isdisjoint(keys[1])


def test_cells_of_a_seed_do_not_depend_on_the_other_seeds_or_their_order():
    def of_seed_3(seeds):
        study = replace(get_preset("paper"), tasks=("door",), seeds=seeds)
        return {
            (cell.fit.label, cell.fit.key, cell.evaluation.key(cell.fit), cell.controller)
            for cell in cells_of(study, {"door": "key"})
            if cell.fit.seed == 3
        }

    assert of_seed_3((3,)) == of_seed_3((7, 3, 1))


def test_every_key_differs_by_seed():
    study = replace(get_preset("paper"), tasks=("door",))
    one, two = (cells_of(replace(study, seeds=(seed,)), {"door": "key"}) for seed in (1, 2))
    for mine, theirs in zip(one, two, strict=True):
        assert mine.fit.key != theirs.fit.key
        assert mine.evaluation.key(mine.fit) != theirs.evaluation.key(theirs.fit)
        if mine.controller:
            assert mine.controller.key != theirs.controller.key
            assert (mine.controller.seed, theirs.controller.seed) == (1, 2)


def test_disturbed_has_each_disturbance_of_a_task_beside_none():
    study = replace(
        get_preset("beyond"), seeds=(1,), methods=("nearest",), episodes={"disturbed": 5}
    )
    cells = cells_of(study, dict.fromkeys(study.tasks, "key"))
    for task in study.tasks:
        found = [c.evaluation.disturbance for c in cells if c.fit.task == task]
        assert found.count("none") == 2  # the method's and the expert's
        assert set(found) == {"none", *names_of(get_task(task))}
    assert all(cell.evaluation.physics == "nominal" for cell in cells)


def test_closed_loop_replans_what_can_replan_in_the_same_conditions_as_never():
    study = replace(
        get_preset("beyond"), tasks=("relocation",), seeds=(1,), episodes={"closed_loop": 5}
    )
    cells = cells_of(study, {"relocation": "key"})
    assert {cell.fit.method for cell in cells} == {"kodex", "nn", "nearest"}
    conditions = {}
    for cell in cells:
        place = cell.evaluation.physics, cell.evaluation.disturbance
        conditions.setdefault(cell.evaluation.replan, set()).add(place)
    assert set(conditions) == {0, 20, 5, 1}
    assert len({frozenset(places) for places in conditions.values()}) == 1
    assert len(conditions[0]) == 5 + 3
