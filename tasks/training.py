"""Train an expert: PPO of stable-baselines3 over the batch simulator.

A run is a folder that holds ``checkpoint.safetensors`` and ``log.jsonl``. The same call again goes
on from the checkpoint. What comes of it, ``<task>.safetensors`` and its card ``<task>.json``, is
what `tasks/experts/` ships.
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
from gymnasium import spaces
from safetensors import safe_open
from safetensors.numpy import load, save
from safetensors.torch import save_file
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import VecNormalize
from stable_baselines3.common.vec_env.base_vec_env import VecEnv

from tasks.base import Task
from tasks.data import FloatArray, generator
from tasks.errors import InputError
from tasks.experts import CLIP, Expert, evaluate, expert_input
from tasks.files import whole_file
from tasks.recipes import RECIPES, Recipe
from tasks.simulator import Simulator

CARD_EPISODES = 10_000
EPSILON = 1e-8
"""Added to the variance of an input before it is divided by."""

Report = Callable[[dict[str, float]], None]


def train(task: Task, folder: Path, report: Report, threads: int = 2) -> Path:
    """Trains the expert of a task, or goes on with it; returns the checkpoint.

    Args:
        task: what the expert is to do.
        folder: where checkpoint and log are kept.
        report: called after each iteration with what the log says of it.
        threads: how many to simulate on.

    Raises:
        InputError: another process trains in the folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with FileLock(folder / ".lock", timeout=0):
            return _train(task, folder, report, threads)
    except Timeout as error:
        raise InputError(f"another training is writing to {folder}: wait for it") from error


def _train(task: Task, folder: Path, report: Report, threads: int) -> Path:
    recipe = RECIPES[task.name]
    torch.set_num_threads(threads)
    episodes = EpisodesEnv(task, recipe, threads)
    env = VecNormalize(episodes, gamma=recipe.discount, clip_obs=CLIP, epsilon=EPSILON)
    _seed(task, 0)
    model = _model(env, recipe)
    progress = Progress(episodes, folder, recipe, report)
    if progress.checkpoint.exists():
        progress.load(model, env)
        _seed(task, model.num_timesteps)
    remaining = recipe.steps - model.num_timesteps
    if remaining > 0:
        model.learn(remaining, callback=progress, reset_num_timesteps=model.num_timesteps == 0)
    return progress.checkpoint


def _seed(task: Task, steps: int) -> None:
    """Seeds the global streams, which stable-baselines3 draws from, anew for each resumption."""
    set_random_seed(int(generator("expert", task.name, steps).integers(2**31)))


def write_expert(task: Task, folder: Path) -> Path:
    """Writes the expert that a run has come to, with its card; returns the card's path.

    The card holds the recipe, the cost, and success on the first 10,000 starts of ``probe`` and
    ``ood``, which nothing was trained on.
    """
    tensors, metadata = read_checkpoint(folder)
    data = save(expert_weights(tensors))
    expert = Expert(load(data))
    success = {split: evaluate(task, expert, split, CARD_EPISODES) for split in ("probe", "ood")}
    recipe = asdict(RECIPES[task.name])
    card = {
        "task": task.name,
        "task_version": task.version,
        "model_hash": task.model_hash,
        "mujoco": mujoco.__version__,
        "weights_sha256": hashlib.sha256(data).hexdigest(),
        "recipe": recipe | {"reward": recipe["reward"].__name__},
        "steps": int(metadata["steps"]),
        "wall_seconds": round(float(metadata["seconds"])),
        "episodes": CARD_EPISODES,
        "success": success,
    }
    path = folder / f"{task.name}.json"
    with whole_file(path) as file, whole_file(path.with_suffix(".safetensors")) as weights:
        weights.write_bytes(data)
        file.write_text(json.dumps(card, indent=2) + "\n")
    return path


def expert_weights(tensors: dict[str, torch.Tensor]) -> dict[str, FloatArray]:
    """Returns what `Expert` takes, from a checkpoint: without critic, noise and time."""
    policy = _below(tensors, "policy.")
    layers = [_below(policy, f"mlp_extractor.policy_net.{2 * i}.") for i in range(2)]
    layers.append(_below(policy, "action_net."))
    layers[0]["weight"] = layers[0]["weight"][:, :-1]
    weights = {f"{k}{i}": v.numpy() for i, layer in enumerate(layers) for k, v in layer.items()}
    weights["mean"] = tensors["obs.mean"].numpy()[:-1]
    weights["std"] = np.sqrt(tensors["obs.var"].numpy()[:-1] + EPSILON)
    return {name: np.ascontiguousarray(values) for name, values in weights.items()}


def _model(env: VecNormalize, recipe: Recipe) -> PPO:
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
        """Returns the observations (B, I) with a zero in place of the time."""
        return torch.nn.functional.pad(observations[:, :-1], (0, 1))


class TimeBlindPolicy(ActorCriticPolicy):
    """A reactive policy, whose critic alone knows the time: what is left to earn depends on it."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.pi_features_extractor = WithoutTime(self.observation_space)


class EpisodesEnv(VecEnv):
    """Whole episodes of a task that begin and end together, at ever new starts of ``train``."""

    def __init__(self, task: Task, recipe: Recipe, threads: int) -> None:
        self.task, self.recipe, self.threads = task, recipe, threads
        self.first = 0
        self.calm = 0.0
        """Share of the prices that is asked for at present."""
        self.offset = 0.0
        """Standard deviation of the actions' error at present."""
        self.success = 0.0
        """Success of the episodes that ended last, with action noise."""
        self.earned = 0.0
        """Mean reward of a step in the episodes that ended last."""
        self._previous: FloatArray | None = None
        self._begin()
        width = self._observe().shape[1]
        limits = spaces.Box(-1.0, 1.0, (task.layout.action_dim,), np.float32)
        super().__init__(recipe.episodes, spaces.Box(-np.inf, np.inf, (width,)), limits)

    def reset(self) -> FloatArray:
        """Returns the observations of new episodes, (B, I)."""
        self._begin()
        return self._observe()

    def step_async(self, actions: FloatArray) -> None:
        """Takes the actions (B, A) of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[FloatArray, FloatArray, FloatArray, list[dict[str, Any]]]:
        """Returns observations, rewards and ends of the step, and no further information."""
        actions = np.clip(self._actions, -1.0, 1.0)
        self.simulator.step(np.clip(actions + self.offset * self._error, -1.0, 1.0))
        self._readings.append(self.simulator.read())
        rewards = self._reward(actions)
        self._rewards.append(rewards)
        self._previous = actions
        ended = len(self._readings) == self.task.steps
        if ended:
            self.success = float(self.task.success(np.stack(self._readings, axis=1)).mean())
            self.earned = float(np.mean(self._rewards))
            self._begin()
        ends = np.full(self.num_envs, ended)
        return self._observe(), rewards, ends, [{} for _ in range(self.num_envs)]

    def _begin(self) -> None:
        starts = self.task.sample("train", self.first + self.recipe.episodes)[self.first :]
        self.first += self.recipe.episodes
        self.simulator = Simulator(self.task, starts, threads=self.threads)
        self._readings: list[FloatArray] = []
        self._rewards: list[FloatArray] = []
        self._previous = None
        rng = generator("error of the actions", self.task.name, self.first)
        self._error = rng.standard_normal((self.recipe.episodes, self.task.layout.action_dim))

    def _observe(self) -> FloatArray:
        elapsed = np.full((len(self.simulator.starts), 1), len(self._readings) / self.task.horizon)
        return np.concatenate([expert_input(self.simulator), elapsed], axis=1)

    def _reward(self, actions: FloatArray) -> FloatArray:
        batch, recipe = self.simulator.batch, self.recipe
        previous = actions if self._previous is None else self._previous
        jerk = ((actions - previous) ** 2).mean(axis=1)
        speed = (batch.qvel[:, : self.task.robot_dim] ** 2).mean(axis=1)
        calm = self.calm * (recipe.action_rate * jerk + recipe.hand_speed * speed)
        return np.where(self.simulator.diverged, 0.0, recipe.reward(batch) - calm)

    def close(self) -> None:
        """Needs nothing."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Returns an attribute as often as there are episodes."""
        return [getattr(self, attr_name, None)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Is not supported: episodes begin and end together."""
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Is not supported: episodes begin and end together."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Returns that no episode is wrapped."""
        return [False] * self.num_envs


class Progress(BaseCallback):
    """Before each iteration: schedules, a log line, and a checkpoint that replaces the last."""

    def __init__(self, episodes: EpisodesEnv, folder: Path, recipe: Recipe, report: Report) -> None:
        super().__init__()
        self.episodes, self.recipe, self.report = episodes, recipe, report
        self.checkpoint = folder / "checkpoint.safetensors"
        self.log = folder / "log.jsonl"
        self.saved_steps = 0
        self.seconds = 0.0
        self.clock = time.monotonic()

    def _on_rollout_start(self) -> None:
        steps = self.model.num_timesteps
        self.episodes.calm = self.recipe.calm_at(steps)
        self.episodes.offset = self.recipe.offset_at(steps)
        self.model.policy.log_std.data.clamp_(max=float(np.log(self.recipe.noise_at(steps))))
        if self.model.num_timesteps > self.saved_steps:
            self.save()

    def _on_step(self) -> bool:
        return True

    def _on_training_end(self) -> None:
        self.save()

    def save(self) -> None:
        """Writes the checkpoint and one line of the log."""
        now = time.monotonic()
        self.seconds, self.clock = self.seconds + now - self.clock, now
        model, env = self.model, self.training_env
        row = {
            "steps": model.num_timesteps,
            "seconds": round(self.seconds, 1),
            "success": round(self.episodes.success, 4),
            "reward": round(self.episodes.earned, 4),
            "std": round(float(model.policy.log_std.detach().exp().mean()), 4),
        }
        tensors = {f"policy.{k}": v for k, v in model.policy.state_dict().items()}
        for index, state in model.policy.optimizer.state_dict()["state"].items():
            tensors |= {f"adam.{index}.{key}": value for key, value in state.items()}
        for name, rms in (("obs", env.obs_rms), ("ret", env.ret_rms)):
            parts = {"mean": rms.mean, "var": rms.var, "count": rms.count}
            tensors |= {f"{name}.{k}": torch.as_tensor(v) for k, v in parts.items()}
        metadata = {"steps": row["steps"], "seconds": row["seconds"], "first": self.episodes.first}
        tensors = {key: value.contiguous() for key, value in tensors.items()}
        with whole_file(self.checkpoint) as file:
            save_file(tensors, file, {key: str(value) for key, value in metadata.items()})
        self.saved_steps = model.num_timesteps
        with self.log.open("a") as lines:
            lines.write(json.dumps(row) + "\n")
        self.report(row)

    def load(self, model: PPO, env: VecNormalize) -> None:
        """Brings model and normalisation back to the checkpoint."""
        tensors, metadata = read_checkpoint(self.checkpoint.parent)
        model.num_timesteps = self.saved_steps = int(metadata["steps"])
        self.seconds = float(metadata["seconds"])
        self.episodes.first = int(metadata["first"])
        policy = _below(tensors, "policy.")
        model.policy.load_state_dict(policy)
        state: dict[int, dict[str, torch.Tensor]] = {}
        for key, value in _below(tensors, "adam.").items():
            index, name = key.split(".", 1)
            state.setdefault(int(index), {})[name] = value
        optimizer = model.policy.optimizer
        optimizer.load_state_dict({**optimizer.state_dict(), "state": state})
        for name, rms in (("obs", env.obs_rms), ("ret", env.ret_rms)):
            for key, value in _below(tensors, f"{name}.").items():
                number = value.numpy()
                setattr(rms, key, number if number.ndim else number.item())


def read_checkpoint(folder: Path) -> tuple[dict[str, torch.Tensor], dict[str, str]]:
    """Returns the tensors of a run's checkpoint, and its counts of steps and seconds.

    Raises:
        InputError: the folder holds none.
    """
    path = folder / "checkpoint.safetensors"
    if not path.exists():
        reason = f"it holds no {path.name}" if folder.exists() else "it does not exist"
        raise InputError(f"{folder} is no folder of `bench expert train`: {reason}")
    with safe_open(path, "pt") as file:
        names = file.keys()
        return {name: file.get_tensor(name) for name in names}, file.metadata()


def _below(tensors: dict[str, torch.Tensor], prefix: str) -> dict[str, torch.Tensor]:
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}
