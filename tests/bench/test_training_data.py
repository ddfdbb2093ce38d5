"""What fits and controllers learn from, and where evaluations start, with a small random expert."""

from dataclasses import replace

import numpy as np
import pytest

from bench.controller import ControllerConfig
from bench.controller_kinds import ON_SUCCESSES, ORIGINAL, TUNED, UNCLIPPED
from bench.spec import Cell, ControllerSpec, Evaluation, Fit
from bench.training_data import (
    controller_demos,
    starts_of,
    training_demos,
    validation_demos,
    wanted_episodes,
)
from tasks.data import UnclippedDemos
from tasks.demos import adopt_demos, demos_key, demos_path, load_demos
from tasks.demos_files import save_demos

pytestmark = [
    pytest.mark.parametrize("task", ["door"], indirect=True),
    pytest.mark.usefixtures("shipped"),
]


@pytest.fixture
def fit(task, shipped):
    return Fit("door", "kodex", "described", "single", {}, 4, 0, demos_key(task))


@pytest.fixture
def spec(task, shipped):
    return ControllerSpec("door", ORIGINAL, ControllerConfig(), 4, demos_key(task))


def test_a_fit_learns_from_the_first_training_demonstrations(task, fit):
    demos = load_demos(task)
    assert (len(training_demos(fit)), len(validation_demos(fit))) == (4, 2)
    np.testing.assert_array_equal(training_demos(fit).states, demos.states[:4])
    np.testing.assert_array_equal(validation_demos(fit).states, demos.states[6:])


def test_the_original_controller_learns_from_the_training_demonstrations(spec, fit):
    np.testing.assert_array_equal(controller_demos(spec).actions, training_demos(fit).actions)


def test_the_unclipped_controller_learns_the_experts_own_actions(spec, fit):
    unclipped = controller_demos(replace(spec, kind=UNCLIPPED))
    assert isinstance(unclipped, UnclippedDemos)
    clipped = np.clip(unclipped.actions, -1, 1)
    np.testing.assert_array_equal(clipped, training_demos(fit).actions)
    assert (clipped != unclipped.actions).any()


def test_tuned_controllers_learn_from_rollouts_in_changed_physics_with_or_without_failures(spec):
    tuned = controller_demos(replace(spec, kind=TUNED, physics="heavy_hand"))
    successes = controller_demos(replace(spec, kind=ON_SUCCESSES, physics="heavy_hand"))
    assert tuned.starts.index.tolist() == [0, 1, 2, 3]
    assert successes.starts.index.tolist() == [1, 2]
    lighter = controller_demos(replace(spec, kind=TUNED, physics="light_hand"))
    assert (tuned.states != lighter.states).any()


def test_an_evaluation_has_no_more_episodes_than_starts(task, fit):
    validation = Cell(fit, Evaluation("door", "validation"), 20)
    np.testing.assert_array_equal(starts_of(validation).values, validation_demos(fit).starts.values)
    assert wanted_episodes(validation) == 2
    assert wanted_episodes(replace(validation, episodes=1)) == len(
        starts_of(replace(validation, episodes=1))
    )
    unseen = Cell(fit, Evaluation("door", "test"), 20)
    assert wanted_episodes(unseen) == len(starts_of(unseen)) == 20


def test_counting_episodes_records_no_demonstrations(task, fit):
    assert wanted_episodes(Cell(fit, Evaluation("door", "validation"), 20)) == 2
    assert not demos_path(task).exists()


def test_episodes_from_the_starts_of_a_file_are_counted(task, fit, tmp_path):
    save_demos(load_demos(task)[:5], tmp_path / "mine")
    own = replace(fit, demos_key=adopt_demos(task, tmp_path / "mine"))
    cell = Cell(own, Evaluation("door", "validation"), 20)
    assert wanted_episodes(cell) == len(starts_of(cell)) == 2
    assert (starts_of(cell).values == load_demos(task).starts.values[3:5]).all()
