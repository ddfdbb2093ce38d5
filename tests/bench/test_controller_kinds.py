"""Controllers as named values."""

from dataclasses import replace

import pytest

from bench.controller import ControllerConfig
from bench.controller_kinds import ABOUT, KINDS, ON_SUCCESSES, ORIGINAL, TUNED, UNCLIPPED
from bench.experiments import cells_of
from bench.presets import get_preset
from bench.spec import ControllerSpec
from bench.study_demos import demos_keys_of
from bench.trained import trained
from tasks.errors import InputError
from tasks.registry import TASKS

SPEC = ControllerSpec("door", ORIGINAL, ControllerConfig(), 10, "key")


@pytest.mark.parametrize("kind", KINDS)
def test_a_controller_is_named_after_its_kind_and_any_later_seed(kind):
    physics = "heavy_hand" if KINDS[kind].changed_physics else "nominal"
    first = replace(SPEC, kind=kind, physics=physics)
    assert (first.name, first.label) == (kind, f"door-{kind}-{physics}")
    third = replace(first, seed=3)
    assert (third.name, third.label) == (f"{kind}-3", f"door-{kind}-3-{physics}")


def test_every_field_of_a_controller_changes_its_key():
    tuned = replace(SPEC, kind=TUNED, physics="heavy_hand")
    others = [
        SPEC,
        tuned,
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
        ControllerSpec("door", kind, ControllerConfig(), 10, "key", physics)


def test_every_controller_of_the_paper_has_a_description():
    study = get_preset("paper")
    cells = cells_of(study, dict.fromkeys(study.tasks, "key"))
    assert {cell.evaluation.controller for cell in cells} == set(ABOUT)


@pytest.mark.parametrize("name", TASKS)
def test_the_original_controllers_of_the_paper_are_shipped(name):
    study = replace(get_preset("paper"), tasks=(name,), methods=("kodex",))
    cells = cells_of(replace(study, episodes={"success": 1}), demos_keys_of(study))
    (controller,) = (cell.controller for cell in cells if cell.controller)
    assert trained(controller) is not None
