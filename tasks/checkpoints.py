"""Checkpoints of expert training: the policy, its optimiser and the normalisation (needs torch)."""

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from tasks.data import FloatArray
from tasks.errors import InputError
from tasks.files import whole_file

EPSILON = 1e-8
"""Added to the variance of an input before its square root divides the input."""
_FILE = "checkpoint.safetensors"
_STATISTICS = {"obs": "obs_rms", "ret": "ret_rms"}
"""Running statistics of stable-baselines3's VecNormalize, by their names in a checkpoint."""
_DIGEST = "sha256"
"""Label of a checkpoint: the SHA-256 of everything else in it."""

Tensors = dict[str, torch.Tensor]


@dataclass(frozen=True)
class Counters:
    """What a training run is of, and how far it has come."""

    task: str
    seed: int
    recipe: dict[str, Any]
    learnt_on: dict[str, Any]
    """What else the policy depends on: the task's version, its model and the reward's source."""
    steps: int
    """Control steps of all episodes together."""
    seconds: float
    first: int
    """Index of the next start of the split ``train``."""


def checkpoint_path(folder: Path) -> Path:
    """Returns where the training run in a folder keeps its checkpoint."""
    return folder / _FILE


def log_path(folder: Path) -> Path:
    """Returns where the training run in a folder keeps its log, a JSON object a line."""
    return folder / "log.jsonl"


def write_checkpoint(folder: Path, model: Any, env: Any, counters: Counters) -> None:
    """Replaces the checkpoint in a folder.

    Args:
        folder: the folder of the training run.
        model: the PPO model of stable-baselines3.
        env: its VecNormalize.
        counters: how far the run has come.
    """
    tensors = {f"policy.{key}": value for key, value in model.policy.state_dict().items()}
    for index, state in model.policy.optimizer.state_dict()["state"].items():
        tensors |= {f"adam.{index}.{key}": value for key, value in state.items()}
    for name, attribute in _STATISTICS.items():
        rms = getattr(env, attribute)
        parts = {"mean": rms.mean, "var": rms.var, "count": rms.count}
        tensors |= {
            f"{name}.{key}": torch.as_tensor(np.asarray(part)) for key, part in parts.items()
        }
    tensors = {key: value.contiguous() for key, value in tensors.items()}
    metadata = {key: json.dumps(value) for key, value in asdict(counters).items()}
    metadata[_DIGEST] = _digest(tensors, metadata)
    with whole_file(checkpoint_path(folder)) as file:
        save_file(tensors, file, metadata)


def read_checkpoint(folder: Path) -> tuple[Tensors, Counters]:
    """Returns the tensors and the counters of a training run's checkpoint.

    Raises:
        InputError: the folder holds no checkpoint, or not as it was written.
    """
    path = checkpoint_path(folder)
    if not path.exists():
        reason = f"it holds no {path.name}" if folder.exists() else "it does not exist"
        raise InputError(f"{folder} is not a folder of `bench expert train`: {reason}")
    damaged = InputError(f"{path} is damaged, or of another version of the suite: remove it")
    try:
        with safe_open(path, "pt") as file:
            metadata, names = dict(file.metadata()), file.keys()
            tensors = {name: file.get_tensor(name) for name in names}
        if metadata.pop(_DIGEST) != _digest(tensors, metadata):
            raise damaged
        return tensors, Counters(**{key: json.loads(text) for key, text in metadata.items()})
    except (SafetensorError, KeyError, TypeError, ValueError) as error:
        raise damaged from error


def _digest(tensors: Tensors, metadata: dict[str, str]) -> str:
    """Returns the SHA-256 of the tensors and texts of a checkpoint."""
    digest = hashlib.sha256(json.dumps(metadata, sort_keys=True).encode())
    for name in sorted(tensors):
        array = tensors[name].numpy()
        digest.update(f"{name} {array.dtype} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def restore(tensors: Tensors, model: Any, env: Any) -> None:
    """Sets a PPO model and its VecNormalize to the tensors of a checkpoint."""
    model.policy.load_state_dict(below(tensors, "policy."))
    state: dict[int, Tensors] = {}
    for key, value in below(tensors, "adam.").items():
        index, name = key.split(".", 1)
        state.setdefault(int(index), {})[name] = value
    optimizer = model.policy.optimizer
    optimizer.load_state_dict({**optimizer.state_dict(), "state": state})
    for name, attribute in _STATISTICS.items():
        for key, value in below(tensors, f"{name}.").items():
            number = value.numpy()
            setattr(getattr(env, attribute), key, number if number.ndim else number.item())


def expert_weights(tensors: Tensors) -> dict[str, FloatArray]:
    """Returns the weights of `tasks.experts.Expert`: the actor without noise and time input."""
    policy = below(tensors, "policy.")
    hidden = below(policy, "mlp_extractor.policy_net.")
    depth = sum(name.endswith("weight") for name in hidden)
    layers = [below(hidden, f"{2 * i}.") for i in range(depth)]  # a tanh stands in between
    layers.append(below(policy, "action_net."))
    layers[0]["weight"] = layers[0]["weight"][:, :-1]
    weights = {f"{k}{i}": v.numpy() for i, layer in enumerate(layers) for k, v in layer.items()}
    weights["mean"] = tensors["obs.mean"].numpy()[:-1]
    weights["std"] = np.sqrt(tensors["obs.var"].numpy()[:-1] + EPSILON)
    return {name: np.ascontiguousarray(values) for name, values in weights.items()}


def below(tensors: Tensors, prefix: str) -> Tensors:
    """Returns the tensors whose names begin with a prefix, under the rest of their names."""
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}
