"""The tracking controller C: from where the hand is and should be next to an action.

C is trained on the demonstrations' (x_r(t), x_r(t+1)) -> tau(t) (appendix A, G), once for each
task, and serves every method.
"""

from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from methods.base import Parameters
from tasks.data import Demos, FloatArray

VERSION = 1
"""Raise it when actions change."""

_Layers = list[tuple[NDArray[np.float32], NDArray[np.float32]]]


@dataclass(frozen=True)
class ControllerConfig:
    """Appendix G, Table 6. The batch size is this suite's: the appendix gives none."""

    hidden: tuple[int, ...] = (4, 4, 2)
    """Widths of the ReLU layers, in multiples of H."""
    learning_rate: float = 1e-4
    epochs: int = 300
    batch_size: int = 32

    def resolved(self) -> dict[str, Any]:
        """Returns what decides the result, for a key."""
        return asdict(self) | {"version": VERSION}


class Controller:
    """A trained C. It computes in float32 on one thread."""

    def __init__(self, weights: Parameters) -> None:
        """Takes ``weight0`` (K, 2 H), ``bias0`` (K,) and so on, as `train_controller` gives."""
        depth = len(weights) // 2
        self._layers: _Layers = [
            (weights[f"weight{i}"].T, weights[f"bias{i}"]) for i in range(depth)
        ]

    def act(self, present: FloatArray, wanted: FloatArray) -> FloatArray:
        """Returns the actions (B, A) from x_r(t) (B, H) towards x_r(t+1) (B, H), not clipped."""
        *hidden, (weight, bias) = self._layers
        # What a diverged prediction asks for may not fit into float32: its episode will diverge.
        with threadpool_limits(1, "blas"), np.errstate(over="ignore", invalid="ignore"):
            x = np.concatenate([present, wanted], axis=1).astype(np.float32)
            for inner_weight, inner_bias in hidden:
                x = np.maximum(x @ inner_weight + inner_bias, 0)
            return (x @ weight + bias).astype(np.float64)


def train_controller(config: ControllerConfig, demos: Demos, name: str) -> Parameters:
    """Returns the weights of a controller after the last epoch.

    Args:
        config: layers and schedule.
        demos: whose hand motions and actions are learnt.
        name: of the task; the random weights and the order of samples are drawn for it.
    """
    import torch
    from torch import nn

    from methods.training import Schedule, minimise, seeded

    robot_dim, action_dim = demos.velocities.shape[-1], demos.actions.shape[-1]
    q = demos.states[:, :, :robot_dim]
    inputs = np.concatenate([q[:, :-1], q[:, 1:]], axis=-1).reshape(-1, 2 * robot_dim)
    data = tuple(
        torch.from_numpy(array.astype(np.float32))
        for array in (inputs, demos.actions.reshape(-1, action_dim))
    )
    widths = (2 * robot_dim, *(factor * robot_dim for factor in config.hidden), action_dim)

    def build() -> nn.Module:
        layers = [part for pair in pairwise(widths) for part in (nn.Linear(*pair), nn.ReLU())]
        return nn.Sequential(*layers[:-1])

    network = seeded(build, "controller", name)
    schedule = Schedule(config.epochs, config.batch_size, config.learning_rate)
    minimise(
        network,
        lambda x, y: nn.functional.mse_loss(network(x), y),
        data,
        schedule,
        "controller",
        name,
    )
    linear = [layer for layer in network.modules() if isinstance(layer, nn.Linear)]
    return {
        f"{kind}{i}": getattr(layer, kind).detach().numpy()
        for kind in ("weight", "bias")
        for i, layer in enumerate(linear)
    }
