"""Trains the expert of a task with stable-baselines3's PPO (extra ``expert``).

A training run is a folder with ``checkpoint.safetensors`` and ``log.jsonl``; a second call resumes
from the checkpoint. `write_expert` then writes the expert, ``<task>.safetensors``, and its card,
``<task>.json``, which `tasks/experts/` ships.
"""

import hashlib
import inspect
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import torch
from filelock import FileLock, Timeout
from safetensors.numpy import load, save
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.common.utils import FloatSchedule, set_random_seed
from stable_baselines3.common.vec_env import VecNormalize
from threadpoolctl import threadpool_limits

from tasks.base import Task
from tasks.checkpoints import (
    EPSILON,
    Counters,
    checkpoint_path,
    expert_weights,
    log_path,
    read_checkpoint,
    restore,
    write_checkpoint,
)
from tasks.data import generator
from tasks.episodes_env import EpisodesEnv
from tasks.errors import InputError
from tasks.experts import CLIP, Expert, evaluate
from tasks.files import whole_file
from tasks.pins import mark
from tasks.product import product
from tasks.recipes import Recipe, Reward, recipe_of

CARD_EPISODES = 10_000
"""Episodes of each split on which the card's success is measured."""
HISTORY = 50
"""Lines of the log that a card keeps."""

Report = Callable[[dict[str, float]], None]


def train(task: Task, folder: Path, report: Report, seed: int = 1, threads: int = 2) -> Path:
    """Trains the expert of a task, or resumes its training; returns the path of the checkpoint.

    The same seed gives the same bytes, whatever the number of threads and of interruptions.

    Args:
        task: the task.
        folder: holds the checkpoint and the log.
        report: called after each iteration with its line of the log.
        seed: of the initial weights, the starts, the noise and the order of minibatches.
        threads: number of threads of the simulator.

    Raises:
        InputError: the task has no recipe, another process trains in the folder, or the folder
            holds a damaged checkpoint, or a training of another task, seed, recipe, reward, model
            or version of the task.
    """
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with FileLock(folder / ".lock", timeout=0), threadpool_limits(1, "blas"):
            Training(task, folder, seed, threads).run(report)
    except Timeout as error:
        raise InputError(f"another training is writing to {folder}: wait for it") from error
    return checkpoint_path(folder)


class Training:
    """A training run, which continues from the checkpoint in its folder.

    Each iteration begins as one after an interruption does: with a new block of episodes, and
    with the global random streams, which stable-baselines3 uses, seeded by the steps done.
    """

    def __init__(self, task: Task, folder: Path, seed: int, threads: int) -> None:
        self.task, self.folder, self.seed, self.recipe = task, folder, seed, recipe_of(task)
        torch.set_num_threads(1)  # as for BLAS: more would add in another order, and gain little
        self.episodes = EpisodesEnv(task, self.recipe, seed, threads)
        self.env = VecNormalize(
            self.episodes, gamma=self.recipe.discount, clip_obs=CLIP, epsilon=EPSILON
        )
        self._seed_streams(0)
        self.model = make_model(self.env, self.recipe)
        self.seconds = 0.0
        if checkpoint_path(folder).exists():
            self._resume()

    def run(self, report: Report) -> None:
        """Trains to the end of the recipe, and writes a checkpoint after each iteration."""
        while self.model.num_timesteps < self.recipe.steps:
            began = time.monotonic()
            self._iterate()
            self.seconds += time.monotonic() - began
            report(self._save())

    def _iterate(self) -> None:
        steps = self.model.num_timesteps
        self.episodes.calm = self.recipe.calm_at(steps)
        self.episodes.offset = self.recipe.offset_at(steps)
        self.model.policy.log_std.data.clamp_(max=float(np.log(self.recipe.noise_at(steps))))
        self.model.lr_schedule = FloatSchedule(self.recipe.rate_at(steps))
        self._seed_streams(steps)
        self.model._last_obs = None  # so that `learn` resets the environment
        self.model.learn(self.recipe.episodes * self.task.steps, reset_num_timesteps=False)
        self._decay(steps)

    def _decay(self, steps: int) -> None:
        policy, rate = self.model.policy, self.recipe.rate_at(steps)
        for layer in (*policy.mlp_extractor.policy_net, policy.action_net):
            if isinstance(layer, torch.nn.Linear):
                layer.weight.data *= 1 - self.recipe.weight_decay * rate

    def _seed_streams(self, steps: int) -> None:
        stream = generator("expert", self.task.name, self.seed, steps)
        set_random_seed(int(stream.integers(2**31)))

    def _save(self) -> dict[str, float]:
        """Writes the checkpoint and a line of the log, and returns that line."""
        steps = self.model.num_timesteps
        counters = Counters(
            self.task.name,
            self.seed,
            self.recipe.as_dict(),
            self._learnt_on(),
            steps,
            self.seconds,
            self.episodes.first,
        )
        write_checkpoint(self.folder, self.model, self.env, counters)
        row = {
            "steps": steps,
            "seconds": round(self.seconds, 1),
            "success": round(self.episodes.success, 4),
            "reward": round(self.episodes.earned, 4),
            "std": round(float(self.model.policy.log_std.detach().exp().mean()), 4),
        }
        with log_path(self.folder).open("a") as lines:
            lines.write(json.dumps(row) + "\n")
        return row

    def _resume(self) -> None:
        tensors, found = read_checkpoint(self.folder)
        if (found.task, found.seed) != (self.task.name, self.seed):
            raise InputError(
                f"{self.folder} holds a training of {found.task} with seed {found.seed}, not of"
                f" {self.task.name} with seed {self.seed}: name another folder"
            )
        now = self.recipe.as_dict()
        if changed := [name for name in now if found.recipe.get(name) != now[name]]:
            raise InputError(
                f"{self.folder} holds a training by a recipe that has changed since"
                f" ({', '.join(changed)}): name another folder"
            )
        here = self._learnt_on()
        if changed := [name for name in here if found.learnt_on.get(name) != here[name]]:
            raise InputError(
                f"{self.folder} holds a training of {found.task} as it was before a change of its"
                f" {' and '.join(changed)}: name another folder"
            )
        self.model.num_timesteps = found.steps
        self.seconds, self.episodes.first = found.seconds, found.first
        restore(tensors, self.model, self.env)

    def _learnt_on(self) -> dict[str, Any]:
        return {
            "version": self.task.version,
            "model": self.task.model_hash,
            "reward": hashlib.sha256(_source(self.recipe.reward).encode()).hexdigest(),
        }


def _source(function: Reward) -> str:
    """Returns the source of a function; empty if it was typed in and is in no file."""
    try:
        return inspect.getsource(function)
    except OSError:
        return ""


def write_expert(task: Task, folder: Path) -> Path:
    """Writes the expert of a training run's checkpoint and its card; returns the card's path.

    The card holds the recipe, the seed, the cost, how success grew, and success on the first
    `CARD_EPISODES` starts of ``probe`` and ``ood``, on which nothing was trained.

    Raises:
        InputError: the folder holds no checkpoint.
    """
    tensors, counters = read_checkpoint(folder)
    data = save(expert_weights(tensors))
    expert = Expert(load(data))
    success = {split: evaluate(task, expert, split, CARD_EPISODES) for split in ("probe", "ood")}
    card = {
        "task": task.name,
        "task_version": task.version,
        "model_hash": task.model_hash,
        "mujoco": mujoco.__version__,
        "kernels": mark(),
        "weights_sha256": hashlib.sha256(data).hexdigest(),
        "recipe": counters.recipe,
        "seed": counters.seed,
        "steps": counters.steps,
        "wall_seconds": round(counters.seconds),
        "history": _history(folder),
        "episodes": CARD_EPISODES,
        "success": success,
    }
    path = folder / f"{task.name}.json"
    with whole_file(path) as file, whole_file(path.with_suffix(".safetensors")) as weights:
        weights.write_bytes(data)
        file.write_text(json.dumps(card, indent=2) + "\n")
    return path


def _history(folder: Path) -> list[dict[str, float]]:
    """Returns `HISTORY` lines of the log, evenly spread, with the last."""
    lines = log_path(folder).read_text().splitlines()
    chosen = np.linspace(0, len(lines) - 1, min(HISTORY, len(lines))).round().astype(int)
    return [json.loads(lines[i]) for i in chosen]


def make_model(env: VecNormalize, recipe: Recipe) -> PPO:
    """Returns an untrained PPO model with the settings of a recipe."""
    steps = env.venv.task.steps
    return PPO(
        TimeBlindPolicy,
        env,
        learning_rate=recipe.learning_rate,
        n_steps=steps,
        batch_size=recipe.episodes * steps // recipe.minibatches,
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


class Linear(torch.nn.Linear):
    """torch's layer by `tasks.product`, which computes the same on processors of all vendors."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Returns (B, K) for x (B, I)."""
        return product(x[None], self.weight.mT[None])[0] + self.bias


class TimeBlindPolicy(ActorCriticPolicy):
    """A reactive actor, and a critic that also sees the time, on which future reward depends."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.pi_features_extractor = WithoutTime(self.observation_space)
        for layer in self.modules():
            if isinstance(layer, torch.nn.Linear):
                layer.__class__ = Linear

    @staticmethod
    def init_weights(module: torch.nn.Module, gain: float = 1.0) -> None:
        """Sets a layer to orthogonal weights, by NumPy for the same reason as `Linear`."""
        if isinstance(module, torch.nn.Linear):
            rows, columns = module.weight.shape
            drawn = torch.randn(max(rows, columns), min(rows, columns)).numpy()
            q, r = np.linalg.qr(drawn)
            weight = q * np.sign(np.diag(r))
            module.weight.data = gain * torch.tensor(weight if rows > columns else weight.T)
            module.bias.data.fill_(0.0)
