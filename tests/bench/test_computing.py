"""What a job computes, against the same by hand."""

from dataclasses import asdict
from types import SimpleNamespace

import numpy as np
import pytest

from bench import timing
from bench.computing import evaluate, fit_methods, imitation_error
from bench.controller import Controller
from bench.jobs import stored_bytes
from bench.machine import random_demos
from bench.probe import Recorded
from bench.rollout import TrackedMotion
from bench.spec import Cell, Evaluation, Fit
from methods.contract import loaded
from methods.kodex import Kodex
from tasks.data import Demos, Starts, generator
from tasks.disturbed import disturbed
from tasks.experts import load_expert
from tasks.files import to_bytes
from tasks.registry import get_task
from tasks.simulator import rollout

PEN = get_task("reorientation")
"""Its readings depend on every motion of the hand."""


def expert_cell(expert="first", **conditions):
    fit = Fit(conditions["task"], "expert", "", "", {}, 0, 1, "", expert=expert)
    return Cell(fit, Evaluation(**{"split": "test", "controller": "none", **conditions}), 3)


@pytest.mark.parametrize(
    "conditions",
    [
        {"task": "door"},
        {"task": "door", "physics": "heavy_palm"},
        {"task": "door", "disturbance": "joints_off_0.15+late_2"},
        {"task": "tool", "rule": "published"},
    ],
    ids=str,
)
def test_an_evaluation_of_the_expert_is_its_rollout_in_these_conditions(conditions):
    cell = expert_cell(**conditions)
    task = get_task(cell.evaluation.task, cell.evaluation.rule)
    starts = task.sample("test", 3, 1)
    policy = disturbed(load_expert(task).policy, cell.evaluation.disturbance, task)
    expected = rollout(task, starts, policy, cell.evaluation.physics, threads=1)
    (found,) = evaluate(cell, starts, 0, b"", b"", threads=1)
    np.testing.assert_array_equal(found.episodes.readings, expected.readings)
    np.testing.assert_array_equal(found.episodes.success, expected.success)
    if len(conditions) > 1:
        plain = rollout(get_task(task.name), starts, load_expert(task).policy, threads=1)
        assert plain.readings.shape != expected.readings.shape or not np.array_equal(
            plain.readings, expected.readings, equal_nan=True
        )


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_the_second_expert_acts_where_it_is_asked_for(task, two_shipped):
    starts = task.sample("test", 3, 1)
    readings = []
    for name in ("first", "second"):
        (found,) = evaluate(expert_cell(name, task="door"), starts, 0, b"", b"", threads=1)
        expected = rollout(task, starts, load_expert(task, name).policy, threads=1)
        np.testing.assert_array_equal(found.episodes.readings, expected.readings)
        readings.append(found.episodes.readings)
    assert not np.array_equal(*readings)


def pushing(task):
    """The weights of a controller of one layer that pushes towards the next position."""
    rng, width = generator("pushing"), task.layout.action_dim
    return {
        "layer0.weight": rng.normal(size=(width, 2 * task.robot_dim)).astype(np.float32),
        "layer0.bias": np.zeros(width, np.float32),
    }


@pytest.mark.parametrize("replan", [0, 5])
def test_an_evaluation_of_a_method_tracks_its_motions(replan):
    config = asdict(Kodex.sizes["single"]) | {"observables": 1}
    fit = Fit(PEN.name, "kodex", "described", "single", config, 16, 1, "some")
    training, validation = random_demos(PEN.name)
    (made,) = fit_methods([fit], [training], [validation])
    weights, starts = pushing(PEN), PEN.sample("test", 3, 1)
    cell = Cell(fit, Evaluation(PEN.name, "test", controller_key="some", replan=replan), 3)
    (found,) = evaluate(cell, starts, 0, made.parameters, to_bytes(weights), threads=1)
    method = loaded(Kodex, fit.config, PEN.layout, made.parameters)
    expected = rollout(PEN, starts, TrackedMotion(method, Controller(weights), replan), threads=1)
    np.testing.assert_array_equal(found.episodes.readings, expected.readings)
    other = TrackedMotion(method, Controller(weights), 3)
    assert not np.array_equal(rollout(PEN, starts, other, threads=1).readings, expected.readings)


def test_a_method_is_tracked_with_its_own_controller_not_with_the_one_that_it_starts_from():
    """Fine-tuned controllers start from the weights of another."""
    start = SimpleNamespace(name="original")
    cell = SimpleNamespace(
        fit=SimpleNamespace(method="kodex"), controller=SimpleNamespace(name="tuned", start=start)
    )
    results = SimpleNamespace(
        parameters=lambda fit: b"learnt", controller_weights=lambda spec: spec.name
    )
    assert stored_bytes(cell, results) == (b"learnt", "tuned")


class Drifting(Recorded):
    """Predicts the recorded demonstrations, each later by 0.1 for each step."""

    def rollout(self, start, steps):
        return super().rollout(start, steps) + 0.1 * np.arange(steps + 1)[:, None]


def test_the_imitation_error_is_the_mean_over_demonstrations_and_steps_of_each_joint():
    count, times = 4, 6
    states = generator("drifting").normal(size=(count, times, 5))
    starts = Starts("door", "demo", np.arange(count), np.zeros((count, 1)))
    actions = np.zeros((count, times - 1, 1))
    demos = Demos(starts, states, states[:, :, :2], actions)
    errors = [0.1 * t for _ in range(count) for t in range(1, times)]
    found = imitation_error(Drifting(demos), demos)
    np.testing.assert_allclose(found, [np.mean(errors)] * 2)


@pytest.mark.parametrize("epochs", [1, 2, 7, 200])
def test_the_time_of_a_fit_is_what_it_costs_once_and_each_epoch(epochs, monkeypatch):
    def fitted(fits, demos, validation):
        return [SimpleNamespace(seconds=0.2 + 0.003 * fits[0].config["epochs"], parameters=b"")]

    monkeypatch.setattr(timing, "fit_methods", fitted)
    monkeypatch.setattr(timing, "loaded", lambda *given: None)
    monkeypatch.setattr(timing, "_answer_seconds", lambda method, episode: 0.5)
    fit = Fit("door", "nn", "described", "small", {"epochs": epochs}, 16, 1, "some")
    demos, validation = random_demos("door")
    found = timing.timing_job(fit, demos, validation)
    assert found.fit == pytest.approx([0.2 + 0.003 * epochs] * timing.REPEATS)
    assert found.action == pytest.approx([0.5 / demos.actions.shape[1]] * timing.REPEATS)
