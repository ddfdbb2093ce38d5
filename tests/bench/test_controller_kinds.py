"""Controllers as named values."""

from dataclasses import replace

import pytest

from bench.controller import ControllerConfig
from bench.controller_kinds import (
    ABOUT,
    FINE_TUNED,
    KINDS,
    ON_SUCCESSES,
    ORIGINAL,
    TUNED,
    UNCLIPPED,
)
from bench.experiments import cells_of
from bench.jobs import ControllerJob
from bench.presets import PRESETS, get_preset
from bench.spec import ControllerSpec, controller_blocks
from bench.study_demos import demos_keys_of
from bench.trained import trained
from tasks.errors import InputError
from tasks.registry import TASKS

SPEC = ControllerSpec("door", ORIGINAL, ControllerConfig(), 10, "key", 1)
TUNED_SPEC = replace(SPEC, kind=TUNED, physics="heavy_hand")
FINE = replace(TUNED_SPEC, kind=FINE_TUNED, start=SPEC)


@pytest.mark.parametrize("kind", KINDS)
def test_the_label_of_a_controller_shows_its_kind_its_physics_and_its_seed(kind):
    physics = "heavy_hand" if KINDS[kind].changed_physics else "nominal"
    start = SPEC if KINDS[kind].starts_from else None
    first = replace(SPEC, kind=kind, physics=physics, start=start)
    assert first.label == f"door-{kind}-{physics}-s1"
    assert replace(first, seed=3).label == f"door-{kind}-{physics}-s3"


def test_every_field_of_a_controller_changes_its_key():
    tuned = TUNED_SPEC
    others = [
        SPEC,
        tuned,
        FINE,
        replace(SPEC, task="tool"),
        replace(SPEC, kind=UNCLIPPED),
        replace(tuned, kind=ON_SUCCESSES),
        replace(SPEC, config=ControllerConfig(epochs=1)),
        replace(SPEC, demos=11),
        replace(SPEC, demos_key="other"),
        replace(tuned, physics="light_hand"),
        replace(SPEC, seed=2),
    ]
    assert len({spec.key for spec in others}) == len(others)


def test_another_original_controller_changes_the_key_of_what_starts_from_it():
    starts = [SPEC, replace(SPEC, demos_key="other"), replace(SPEC, demos=11)]
    assert len({replace(FINE, start=start).key for start in starts}) == 3


def test_controllers_of_all_seeds_and_physics_train_together_and_others_apart():
    light = replace(TUNED_SPEC, physics="light_hand")
    together = [TUNED_SPEC, light, replace(light, seed=2)]
    fine = [replace(FINE, seed=s, start=replace(SPEC, seed=s)) for s in (1, 2, 3)]
    others = [SPEC, replace(TUNED_SPEC, demos=11)]
    found = controller_blocks([*together, *fine, *others])
    assert found == [together, fine, *([one] for one in others)]
    many = [replace(SPEC, seed=seed) for seed in range(1, 30)]
    assert controller_blocks(many) == [many[:12], many[12:24], many[24:]]
    assert ControllerJob(tuple(together), cached=False).label == (
        "door-tuned-heavy_hand-s1 door-tuned-light_hand-s1,2"
    )


@pytest.mark.parametrize(
    ("kind", "physics", "answer"),
    [
        (ORIGINAL, "heavy_hand", "original learns in nominal physics, got 'heavy_hand'"),
        (UNCLIPPED, "heavy_hand", "unclipped learns in nominal physics, got 'heavy_hand'"),
        (TUNED, "nominal", "tuned learns in changed physics, got 'nominal'"),
        ("tunned", "heavy_hand", "unknown kind of controller 'tunned': .* did you mean 'tuned'"),
    ],
)
def test_an_invalid_kind_or_physics_of_a_controller_is_refused(kind, physics, answer):
    with pytest.raises(InputError, match=answer):
        ControllerSpec("door", kind, ControllerConfig(), 10, "key", 1, physics)


@pytest.mark.parametrize(
    ("spec", "start", "answer"),
    [
        (FINE, None, "fine-tuned starts from original weights, got random"),
        (FINE, TUNED_SPEC, "fine-tuned starts from original weights, got tuned"),
        (TUNED_SPEC, SPEC, "tuned starts from random weights, got original"),
    ],
)
def test_a_controller_that_starts_from_other_weights_than_its_kind_is_refused(spec, start, answer):
    with pytest.raises(InputError, match=answer):
        replace(spec, start=start)


def test_every_controller_of_the_presets_has_a_description():
    studies = [replace(get_preset(name), tasks=("door",), seeds=(1,)) for name in PRESETS]
    cells = [cell for study in studies for cell in cells_of(study, {"door": "key"})]
    assert {cell.evaluation.controller for cell in cells} == set(ABOUT)


@pytest.mark.parametrize("name", TASKS)
def test_the_controllers_of_quick_are_shipped(name):
    study = replace(get_preset("quick"), tasks=(name,), methods=("kodex",))
    cells = cells_of(replace(study, episodes={"success": 1}), demos_keys_of(study))
    controllers = [cell.controller for cell in cells if cell.controller]
    assert {controller.seed for controller in controllers} == {1, 2}
    assert all(trained(controller) is not None for controller in controllers)
