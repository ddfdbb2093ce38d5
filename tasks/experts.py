"""Experts: reactive networks that demonstrate the tasks, as shipped in `tasks/experts/`."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import load

from tasks.base import Task
from tasks.data import FloatArray
from tasks.errors import InputError
from tasks.masses import NOMINAL
from tasks.simulator import Simulator, rollout

SHIPPED = Path(__file__).with_name("experts")
VELOCITY_SCALE = 0.1
"""Scales joint velocities [rad/s] to the size of the other inputs."""
CLIP = 10.0
"""Largest absolute value of a normalised input, as in training."""


def expert_input(simulator: Simulator) -> FloatArray:
    """Returns the input of an expert, (B, I): the observation and the hand's joint velocities."""
    return np.concatenate([simulator.observe(), VELOCITY_SCALE * simulator.velocities()], axis=1)


class Expert:
    """A policy without memory: normalised inputs, tanh layers, linear output; in float64."""

    def __init__(self, weights: dict[str, FloatArray]) -> None:
        """Takes ``mean`` and ``std`` (I,), then ``weight0`` (K, I), ``bias0`` (K,) and so on."""
        wide = {name: values.astype(np.float64) for name, values in weights.items()}
        self._mean, self._std = wide["mean"], wide["std"]
        depth = sum(name.startswith("weight") for name in wide)
        self._layers = [(wide[f"weight{i}"].T, wide[f"bias{i}"]) for i in range(depth)]

    def reset(self, simulator: Simulator) -> None:
        """Does nothing: the expert has no memory."""

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the actions (B, A), unclipped."""
        x = np.clip((expert_input(simulator) - self._mean) / self._std, -CLIP, CLIP)
        *hidden, (weight, bias) = self._layers
        for inner_weight, inner_bias in hidden:
            x = np.tanh(x @ inner_weight + inner_bias)
        return x @ weight + bias


def evaluate(
    task: Task, expert: Expert, split: str, episodes: int, physics: str = NOMINAL
) -> dict[str, int]:
    """Returns how many episodes from the first starts of a split succeed, and how many diverge."""
    outcome = rollout(task, task.sample(split, episodes), expert, physics)
    return {"successes": int(outcome.success.sum()), "diverged": int(outcome.diverged.sum())}


@dataclass(frozen=True)
class ShippedExpert:
    """An expert and its card, which notes the SHA-256 of its weights."""

    policy: Expert
    card: dict[str, Any]


def load_expert(task: Task) -> ShippedExpert:
    """Returns the expert of a task.

    Raises:
        InputError: none is shipped, or its weights do not match the SHA-256 on its card.
    """
    path = SHIPPED / f"{task.name}.json"
    if not path.exists():
        shipped = ", ".join(sorted(other.stem for other in SHIPPED.glob("*.json"))) or "none"
        raise InputError(f"no expert is shipped for task {task.name!r}; shipped are: {shipped}")
    card = json.loads(path.read_text())
    data = (SHIPPED / f"{task.name}.safetensors").read_bytes()
    digest = hashlib.sha256(data).hexdigest()
    if digest != card["weights_sha256"]:
        raise InputError(
            f"the weights of expert {task.name!r} have SHA-256 {digest}, but its card says"
            f" {card['weights_sha256']}: reinstall the package"
        )
    return ShippedExpert(Expert(load(data)), card)
