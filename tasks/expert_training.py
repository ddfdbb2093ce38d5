"""Trains the expert of a task with stable-baselines3's PPO (extra ``expert``).

A training run is a folder with ``checkpoint.safetensors`` and ``log.jsonl``; a second call resumes
from the checkpoint. `write_expert` then writes the expert, ``<task>.safetensors``, and its card,
``<task>.json``, which `tasks/experts/` ships.
"""

import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import torch
from filelock import FileLock, Timeout
from safetensors.numpy import load, save
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecNormalize

from tasks.base import Task
from tasks.checkpoints import (
    EPSILON,
    Counters,
    checkpoint_path,
    expert_weights,
    read_checkpoint,
    restore,
    write_checkpoint,
)
from tasks.data import generator
from tasks.episodes_env import EpisodesEnv
from tasks.errors import InputError
from tasks.experts import CLIP, Expert, evaluate
from tasks.files import whole_file
from tasks.recipes import Recipe, recipe_of

CARD_EPISODES = 10_000
"""Episodes of each split on which the card's success is measured."""

Report = Callable[[dict[str, float]], None]


def train(task: Task, folder: Path, report: Report, threads: int = 2) -> Path:
    """Trains the expert of a task, or resumes its training; returns the path of the checkpoint.

    Args:
        task: the task.
        folder: holds the checkpoint and the log.
        report: called after each iteration with its line of the log.
        threads: number of threads of the simulator and of torch.

    Raises:
        InputError: another process trains in the folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with FileLock(folder / ".lock", timeout=0):
            _train(task, folder, report, threads)
    except Timeout as error:
        raise InputError(f"another training is writing to {folder}: wait for it") from error
    return checkpoint_path(folder)


def _train(task: Task, folder: Path, report: Report, threads: int) -> None:
    recipe = recipe_of(task)
    torch.set_num_threads(threads)
    episodes = EpisodesEnv(task, recipe, threads)
    env = VecNormalize(episodes, gamma=recipe.discount, clip_obs=CLIP, epsilon=EPSILON)
    _seed(task, 0)
    model = make_model(env, recipe)
    iterations = Iterations(episodes, folder, recipe, report)
    if checkpoint_path(folder).exists():
        iterations.resume(model, env)
        _seed(task, model.num_timesteps)
    remaining = recipe.steps - model.num_timesteps
    if remaining > 0:
        model.learn(remaining, callback=iterations, reset_num_timesteps=model.num_timesteps == 0)


def _seed(task: Task, steps: int) -> None:
    """Seeds the global random streams, which stable-baselines3 uses, anew for each resumption."""
    set_random_seed(int(generator("expert", task.name, steps).integers(2**31)))


def write_expert(task: Task, folder: Path) -> Path:
    """Writes the expert of a training run's checkpoint and its card; returns the card's path.

    The card holds the recipe, the cost, and success on the first `CARD_EPISODES` starts of
    ``probe`` and ``ood``, on which nothing was trained.

    Raises:
        InputError: the folder holds no checkpoint.
    """
    tensors, counters = read_checkpoint(folder)
    data = save(expert_weights(tensors))
    expert = Expert(load(data))
    success = {split: evaluate(task, expert, split, CARD_EPISODES) for split in ("probe", "ood")}
    recipe = asdict(recipe_of(task))
    card = {
        "task": task.name,
        "task_version": task.version,
        "model_hash": task.model_hash,
        "mujoco": mujoco.__version__,
        "weights_sha256": hashlib.sha256(data).hexdigest(),
        "recipe": recipe | {"reward": recipe["reward"].__name__},
        "steps": counters.steps,
        "wall_seconds": round(counters.seconds),
        "episodes": CARD_EPISODES,
        "success": success,
    }
    path = folder / f"{task.name}.json"
    with whole_file(path) as file, whole_file(path.with_suffix(".safetensors")) as weights:
        weights.write_bytes(data)
        file.write_text(json.dumps(card, indent=2) + "\n")
    return path


def make_model(env: VecNormalize, recipe: Recipe) -> PPO:
    """Returns an untrained PPO model with the settings of a recipe."""
    samples = recipe.episodes * env.venv.task.steps
    return PPO(
        TimeBlindPolicy,
        env,
        learning_rate=lambda remaining: recipe.rate_at((1 - remaining) * recipe.steps),
        n_steps=samples // recipe.episodes,
        batch_size=samples // recipe.minibatches,
        n_epochs=recipe.epochs,
        gamma=recipe.discount,
        gae_lambda=recipe.gae_lambda,
        clip_range=recipe.clip_range,
        device="cpu",
        policy_kwargs={
            "net_arch": list(recipe.hidden),
            "log_std_init": float(np.log(recipe.initial_std)),
            "share_features_extractor": False,
        },
    )


class WithoutTime(FlattenExtractor):
    """Hides the last input, the time, from the network behind it."""

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Returns the observations (B, I) with zero in place of the time."""
        return torch.nn.functional.pad(observations[:, :-1], (0, 1))


class TimeBlindPolicy(ActorCriticPolicy):
    """A reactive actor, and a critic that also sees the time, on which future reward depends."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.pi_features_extractor = WithoutTime(self.observation_space)


class Iterations(BaseCallback):
    """Before each iteration, sets the schedules, logs a line and replaces the checkpoint."""

    def __init__(self, episodes: EpisodesEnv, folder: Path, recipe: Recipe, report: Report) -> None:
        super().__init__()
        self.episodes, self.folder, self.recipe, self.report = episodes, folder, recipe, report
        self.saved = Counters()
        self.clock = time.monotonic()

    def _on_rollout_start(self) -> None:
        steps = self.model.num_timesteps
        self.episodes.calm = self.recipe.calm_at(steps)
        self.episodes.offset = self.recipe.offset_at(steps)
        self.model.policy.log_std.data.clamp_(max=float(np.log(self.recipe.noise_at(steps))))
        if steps > self.saved.steps:
            self._save()

    def _on_step(self) -> bool:
        return True

    def _on_training_end(self) -> None:
        self._save()

    def _save(self) -> None:
        """Writes the checkpoint and a line of the log."""
        now = time.monotonic()
        seconds = self.saved.seconds + now - self.clock
        self.clock = now
        counters = Counters(self.model.num_timesteps, seconds, self.episodes.first)
        write_checkpoint(self.folder, self.model, self.training_env, counters)
        self.saved = counters
        row = {
            "steps": counters.steps,
            "seconds": round(seconds, 1),
            "success": round(self.episodes.success, 4),
            "reward": round(self.episodes.earned, 4),
            "std": round(float(self.model.policy.log_std.detach().exp().mean()), 4),
        }
        with (self.folder / "log.jsonl").open("a") as lines:
            lines.write(json.dumps(row) + "\n")
        self.report(row)

    def resume(self, model: PPO, env: VecNormalize) -> None:
        """Restores model, normalisation and counters from the checkpoint."""
        tensors, self.saved = read_checkpoint(self.folder)
        model.num_timesteps = self.saved.steps
        self.episodes.first = self.saved.first
        restore(tensors, model, env)
