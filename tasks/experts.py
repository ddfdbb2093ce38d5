"""Experts: the policies that demonstrate the tasks.

Each of the suite's tasks has two, from separate trainings: reactive networks, shipped in
`tasks/experts/`. A task of a package brings its own, see `tasks.base.Task.expert`.
"""

import hashlib
import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import load

from tasks.base import Task
from tasks.data import FloatArray
from tasks.errors import InputError, described, unknown_name
from tasks.masses import NOMINAL
from tasks.registry import EXPERTS, FIRST
from tasks.simulator import Policy, Simulator, rollout

SHIPPED = Path(__file__).with_name("experts")
VELOCITY_SCALE = 0.1
"""Scales joint velocities [rad/s] to the size of the other inputs."""
CLIP = 10.0
"""Largest absolute value of a normalised input, as in training."""
_DIGEST = "weights_sha256"


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
    task: Task, expert: Policy, split: str, episodes: int, physics: str = NOMINAL
) -> dict[str, int]:
    """Returns how many episodes from the first starts of a split succeed, and how many diverge."""
    outcome = rollout(task, task.sample(split, episodes), expert, physics)
    return {"successes": int(outcome.success.sum()), "diverged": int(outcome.diverged.sum())}


@dataclass(frozen=True)
class LoadedExpert:
    """The expert of a task."""

    policy: Policy
    card: dict[str, Any]
    """What is noted of a shipped one: how it was trained, and the SHA-256 of its weights."""

    @property
    def identity(self) -> str:
        """Tells experts of one version of a task apart: the SHA-256 of shipped weights."""
        return str(self.card.get(_DIGEST, ""))


def experts_of(task: Task) -> tuple[str, ...]:
    """Returns which of `EXPERTS` a task has.

    Raises:
        InputError: a task of a package cannot make its expert.
    """
    found = tuple(name for name in EXPERTS if _card_path(task, name).exists())
    return found or ((FIRST,) if _own(task) is not None else ())


def load_expert(task: Task, name: str = FIRST) -> LoadedExpert:
    """Returns an expert of a task.

    Raises:
        InputError: it has no such expert, a task of a package cannot make it, or the files of a
            shipped one are not as they were shipped.
    """
    path, known = _card_path(task, name), experts_of(task)
    if known and name not in known:
        raise unknown_name(f"expert of {task.name}", name, known)
    if not path.exists():
        own = _own(task)
        if own is None:
            raise InputError(
                f"task {task.name!r} has no expert: give demonstrations with --demos FILE; `bench"
                f" demos record {task.name} --policy FILE.py:NAME --out FILE` makes them from a"
                " policy of yours"
            )
        return LoadedExpert(own, {})
    weights = path.with_suffix(".safetensors")
    try:
        return _shipped(path, weights, path.stat().st_mtime_ns, weights.stat().st_mtime_ns)
    except InputError:
        raise
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"the {name} expert of {task.name} cannot be read ({described(error)}): reinstall the"
            " package"
        ) from error


def _own(task: Task) -> Policy | None:
    """Returns the expert of a package's task, None if it has none."""
    try:
        return task.expert()
    except InputError:
        raise
    except Exception as error:
        raise InputError(
            f"the expert of task {task.name!r} cannot be made: {described(error)}"
        ) from error


@lru_cache
def _shipped(path: Path, weights: Path, *changed: int) -> LoadedExpert:
    """Reads a shipped expert, once unless a file has ``changed``: every key asks for it."""
    card = json.loads(path.read_text())
    data = weights.read_bytes()
    digest = hashlib.sha256(data).hexdigest()
    if digest != card[_DIGEST]:
        raise InputError(
            f"the weights of the {path.parent.name} expert of {path.stem} have SHA-256 {digest},"
            f" but its card says {card[_DIGEST]}: reinstall the package"
        )
    return LoadedExpert(Expert(load(data)), card)


def _card_path(task: Task, name: str) -> Path:
    return SHIPPED / name / f"{task.name}.json"
