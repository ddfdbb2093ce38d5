"""The environment in which stable-baselines3 trains an expert (extra ``expert``)."""

from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env.base_vec_env import VecEnv

from tasks.base import Task
from tasks.data import FloatArray, generator
from tasks.experts import expert_input
from tasks.recipes import Recipe
from tasks.simulator import Simulator


class EpisodesEnv(VecEnv):
    """A block of episodes that begin and end together, each block at new starts of ``train``."""

    def __init__(self, task: Task, recipe: Recipe, seed: int, threads: int) -> None:
        self.task, self.recipe, self.seed, self.threads = task, recipe, seed, threads
        self.first = 0
        """Index of the block's first start."""
        self.calm = 0.0
        """Current weight of the recipe's penalties, from 0 to 1."""
        self.offset = 0.0
        """Current standard deviation of the constant action error."""
        self.success = 0.0
        """Success rate of the last finished block, with action noise."""
        self.earned = 0.0
        """Mean reward per step of the last finished block."""
        self._previous: FloatArray | None = None
        self._begin()
        width = self._observe().shape[1]
        limits = spaces.Box(-1.0, 1.0, (task.layout.action_dim,), np.float32)
        super().__init__(recipe.episodes, spaces.Box(-np.inf, np.inf, (width,)), limits)

    def reset(self) -> FloatArray:
        """Begins the block's episodes anew and returns their observations, (B, I)."""
        self._begin()
        return self._observe()

    def step_async(self, actions: FloatArray) -> None:
        """Stores the actions (B, A) for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[FloatArray, FloatArray, FloatArray, list[dict[str, Any]]]:
        """Returns observations, rewards, ends and empty information of one control step."""
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
            self.first += self.num_envs
            self._begin()
        ends = np.full(self.num_envs, ended)
        return self._observe(), rewards, ends, [{} for _ in range(self.num_envs)]

    def _begin(self) -> None:
        last = self.first + self.recipe.episodes
        starts = self.task.sample("train", last, self.seed)[self.first :]
        self.simulator = Simulator(self.task, starts, threads=self.threads)
        self._readings: list[FloatArray] = []
        self._rewards: list[FloatArray] = []
        self._previous = None
        rng = generator("error of the actions", self.task.name, self.seed, self.first)
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
        """Does nothing: there is nothing to release."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Returns an attribute once per episode."""
        return [getattr(self, attr_name, None)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Raises NotImplementedError: all episodes share one simulator."""
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Raises NotImplementedError: all episodes share one simulator."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Returns False for every episode: none is wrapped."""
        return [False] * self.num_envs
