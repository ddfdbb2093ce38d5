import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from tasks import expert_training as training
from tasks.checkpoints import (
    EPSILON,
    Counters,
    below,
    expert_weights,
    read_checkpoint,
    write_checkpoint,
)
from tasks.episodes_env import EpisodesEnv
from tasks.errors import InputError
from tasks.experts import Expert, expert_input
from tasks.recipes import RECIPES
from tasks.registry import get_task
from tasks.simulator import Simulator

ITERATIONS = 4
EPISODES = 4


@pytest.fixture
def recipe(task, monkeypatch):
    """The task's recipe, shortened to seconds."""
    steps = ITERATIONS * EPISODES * (task.horizon - 1)
    small = replace(
        RECIPES[task.name],
        steps=steps,
        episodes=EPISODES,
        epochs=2,
        minibatches=2,
        hidden=(8, 8),
    )
    monkeypatch.setattr(type(task), "recipe", small)
    return small


def ignore(row):
    """Takes the reports of a training that nobody watches."""


def log(folder):
    return [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]


class KilledError(Exception):
    """Ends a training after an iteration, as a kill would."""


def kill(row):
    raise KilledError


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_killed_training_resumes_and_gives_the_bytes_of_an_undisturbed_one(
    task, recipe, tmp_path
):
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    for done in (1, 2):
        with pytest.raises(KilledError):
            training.train(task, killed, kill, threads=1)
        assert read_checkpoint(killed)[1].steps == done * recipe.steps // ITERATIONS
    training.train(task, killed, ignore, threads=1)
    training.train(task, whole, ignore, threads=2)
    ends = [read_checkpoint(folder) for folder in (killed, whole)]
    assert ends[0][0].keys() == ends[1][0].keys()
    for name, tensor in ends[0][0].items():
        assert torch.equal(tensor, ends[1][0][name]), name
    assert ends[0][1].first == ends[1][1].first == ITERATIONS * EPISODES
    assert ends[0][1].steps == recipe.steps
    before = len(log(killed))
    training.train(task, killed, ignore, threads=1)
    assert len(log(killed)) == before


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_seeds_give_other_experts_and_do_not_share_a_folder(task, recipe, tmp_path):
    first, second = tmp_path / "1", tmp_path / "2"
    training.train(task, first, ignore, seed=1, threads=1)
    training.train(task, second, ignore, seed=2, threads=1)
    name = "policy.action_net.weight"
    assert not torch.equal(read_checkpoint(first)[0][name], read_checkpoint(second)[0][name])
    with pytest.raises(
        InputError, match=r"a training of door with seed 1, not of door with seed 2"
    ):
        training.train(task, first, ignore, seed=2, threads=1)


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_training_by_another_recipe_is_not_continued(task, recipe, tmp_path, monkeypatch):
    training.train(task, tmp_path, ignore, threads=1)
    monkeypatch.setattr(type(task), "recipe", replace(recipe, steps=2 * recipe.steps))
    with pytest.raises(InputError, match=r"a recipe that has changed since \(steps\)"):
        training.train(task, tmp_path, ignore, threads=1)


def door_reward(batch):
    """Has the name of the recipe's reward, and another source."""
    return np.zeros(batch.nbatch)


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_training_of_a_task_that_has_changed_is_not_continued(
    task, recipe, tmp_path, monkeypatch
):
    training.train(task, tmp_path, ignore, threads=1)
    changes = {
        "version": 7,
        "model_hash": "0" * 64,
        "recipe": replace(recipe, reward=door_reward),
    }
    for name, value in changes.items():
        with monkeypatch.context() as changed:
            changed.setattr(type(task), name, value)
            if name == "model_hash":
                vars(task).pop(name, None)
            word = {"model_hash": "model", "recipe": "reward"}.get(name, name)
            with pytest.raises(InputError, match=f"before a change of its {word}: name another"):
                training.train(task, tmp_path, ignore, threads=1)
    training.train(task, tmp_path, ignore, threads=1)


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_damaged_checkpoint_is_refused(task, recipe, tmp_path):
    path = training.train(task, tmp_path, ignore, threads=1)
    sound = path.read_bytes()
    flipped = bytearray(sound)
    flipped[-5] ^= 1
    counted = sound.replace(f'"steps":"{recipe.steps}"'.encode(), b'"steps":"1"')
    for content in (bytes(flipped), counted, sound[:1000], b"", b"no tensors at all"):
        assert content != sound
        path.write_bytes(content)
        with pytest.raises(InputError, match="is damaged, or of another version of the suite"):
            training.train(task, tmp_path, ignore, threads=1)


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_second_training_in_the_same_folder_is_refused(task, recipe, tmp_path):
    def again(row):
        training.train(task, tmp_path, ignore, threads=1)

    with pytest.raises(InputError, match="another training is writing to"):
        training.train(task, tmp_path, again, threads=1)
    assert len(log(tmp_path)) == 1


@pytest.mark.parametrize("task", ["reorientation"], indirect=True)
def test_the_written_expert_acts_like_the_trained_policy(task, recipe, tmp_path, monkeypatch):
    monkeypatch.setattr(training, "CARD_EPISODES", 2)
    training.train(task, tmp_path, ignore, threads=1)
    card = json.loads(training.write_expert(task, tmp_path).read_text())
    assert card["steps"] == recipe.steps
    assert card["recipe"]["reward"] == "reorientation_reward"
    assert set(card["success"]) == {"probe", "ood"}
    simulator = Simulator(task, task.sample("probe", 3))
    tensors, _ = read_checkpoint(tmp_path)
    actions = Expert(expert_weights(tensors)).act(simulator, 0)

    environment = training.VecNormalize(EpisodesEnv(task, recipe, 1, threads=1))
    model = training.make_model(environment, recipe)
    policy = below(tensors, "policy.")
    model.policy.load_state_dict(policy)
    seen = np.concatenate([expert_input(simulator), np.full((3, 1), 0.7)], axis=1)
    scale = np.sqrt(tensors["obs.var"].numpy() + EPSILON)
    normal = torch.as_tensor((seen - tensors["obs.mean"].numpy()) / scale, dtype=torch.float32)
    with torch.no_grad():
        expected = model.policy.get_distribution(normal.clamp(-10, 10)).mode()
    np.testing.assert_allclose(actions, expected, atol=1e-5)


@pytest.mark.parametrize("hidden", [(8,), (16, 8), (8, 8, 8)])
def test_an_expert_has_the_layers_of_its_recipe(recipe, task, tmp_path, hidden):
    recipe = replace(recipe, hidden=hidden)
    environment = training.VecNormalize(EpisodesEnv(task, recipe, 1, threads=1))
    model = training.make_model(environment, recipe)
    counters = Counters(task.name, 1, recipe.as_dict(), {}, 0, 0.0, 0)
    write_checkpoint(tmp_path, model, environment, counters)
    weights = expert_weights(read_checkpoint(tmp_path)[0])
    widths = [weights[f"weight{i}"].shape[0] for i in range(len(hidden) + 1)]
    assert widths == [*hidden, task.layout.action_dim]


def test_only_the_critic_depends_on_the_time(recipe, task):
    environment = training.VecNormalize(EpisodesEnv(task, recipe, 1, threads=1))
    policy = training.make_model(environment, recipe).policy
    early = torch.as_tensor(environment.reset(), dtype=torch.float32)
    late = early.clone()
    late[:, -1] += 1.0
    with torch.no_grad():
        torch.testing.assert_close(
            policy.get_distribution(early).mode(), policy.get_distribution(late).mode()
        )
        assert not torch.equal(policy.predict_values(early), policy.predict_values(late))


def test_each_iteration_uses_new_starts(recipe, task):
    environment = EpisodesEnv(task, recipe, 1, threads=1)
    first = environment.simulator.starts.index.tolist()
    environment.reset()
    assert environment.simulator.starts.index.tolist() == first
    for _ in range(task.steps):
        environment.step_async(np.zeros((EPISODES, task.layout.action_dim)))
        environment.step_wait()
    assert environment.simulator.starts.split == "train"
    assert not set(first) & set(environment.simulator.starts.index.tolist())


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_the_action_error_is_constant_within_an_episode_and_redrawn_for_the_next(recipe, task):
    environment = EpisodesEnv(task, recipe, 1, threads=1)
    environment.offset = 0.1

    def control():
        environment.step_async(np.zeros((EPISODES, task.layout.action_dim)))
        environment.step_wait()
        return environment.simulator.batch.ctrl.copy()

    first = control()
    for _ in range(task.steps - 2):
        np.testing.assert_array_equal(control(), first)
    control()
    assert np.ptp(first, axis=0).all()
    assert (control() != first).all()


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_weight_decay_times_the_learning_rate_is_taken_from_the_weights_of_the_actor(
    recipe, task, tmp_path, monkeypatch
):
    def parameters(decay):
        monkeypatch.setattr(type(task), "recipe", replace(recipe, weight_decay=decay))
        run = training.Training(task, tmp_path / str(decay), seed=1, threads=1)
        run._iterate()
        return dict(run.model.policy.named_parameters())

    plain, decayed = parameters(0.0), parameters(0.2 / recipe.learning_rate)
    actor = ("mlp_extractor.policy_net.", "action_net.")
    for name, tensor in plain.items():
        factor = 0.8 if name.startswith(actor) and name.endswith("weight") else 1.0
        assert torch.allclose(decayed[name], factor * tensor, rtol=1e-6, atol=0), name


def test_rewards_are_finite_and_higher_when_the_task_is_solved(task):
    simulator = Simulator(task, task.sample("train", 5))
    reward = RECIPES[task.name].reward
    before = reward(simulator.batch)
    assert before.shape == (5,)
    assert np.isfinite(before).all()
    solve(simulator)
    assert (reward(simulator.batch) > before + 5).all()


def solve(simulator: Simulator) -> None:
    """Moves the object to where the task succeeds, at the end of the episode."""
    batch, task = simulator.batch, simulator.task
    if task == get_task("door"):
        batch.joint("door_hinge").qpos = 1.5
    elif task == get_task("tool"):
        batch.joint("nail_dir").qpos = 0.091
    elif task == get_task("relocation"):
        batch.qpos[:, 30:33] += batch.site("target").xpos - batch.body("Object").xpos
    else:
        batch.body("target").quat = task.model.body("Object").quat
    batch.time[:] = 0.01 * (task.horizon - 1)
    batch.forward()


@pytest.mark.parametrize(
    ("steps", "rate", "calm", "noise"),
    [
        (0, 3e-4, 0.0, 0.5),
        (45_000, 1.65e-4, 0.5, 0.5),
        (75_000, 0.75e-4, 1.0, np.sqrt(0.5 * 0.1)),
        (100_000, 0.3e-4, 1.0, 0.1),
    ],
)
def test_schedules_follow_the_recipe(steps, rate, calm, noise):
    recipe = replace(RECIPES["relocation"], steps=100_000)
    assert recipe.rate_at(steps) == pytest.approx(rate)
    assert recipe.calm_at(steps) == pytest.approx(calm)
    assert recipe.noise_at(steps) == pytest.approx(noise)
