"""The tracking controller C, which turns a predicted hand motion into actions.

C maps the hand joints now and one step later to an action. It is trained once for each task and
seed on (x_r(t), x_r(t+1)) -> tau(t) of the demonstrations (appendix A, G), and serves every method.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from methods.base import Parameters
from tasks.data import Demos, FloatArray

VERSION = 3
"""To be raised when a change of the code changes actions."""

_Layers = list[tuple[NDArray[np.float32], NDArray[np.float32]]]


@dataclass(frozen=True)
class ControllerConfig:
    """Settings of appendix G, Table 6. The batch size is ours, since the appendix gives none."""

    hidden: tuple[int, ...] = (4, 4, 2)
    """Widths of the ReLU layers, in multiples of H."""
    learning_rate: float = 1e-4
    epochs: int = 300
    batch_size: int = 32

    def resolved(self) -> dict[str, Any]:
        """Returns all that decides what is learnt, for a key."""
        return asdict(self) | {"version": VERSION}


class Controller:
    """A trained controller. It computes in float32."""

    def __init__(self, weights: Parameters) -> None:
        """Takes ``layer0.weight`` (K, 2 H), ``layer0.bias`` (K,) and so on."""
        depth = len(weights) // 2
        self._layers: _Layers = [
            (weights[f"layer{i}.weight"].T, weights[f"layer{i}.bias"]) for i in range(depth)
        ]

    def act(self, present: FloatArray, wanted: FloatArray) -> FloatArray:
        """Returns the actions (B, A) from x_r(t) (B, H) to x_r(t+1) (B, H), not clipped."""
        *hidden, (weight, bias) = self._layers
        # A diverged prediction may exceed float32; its episode then diverges too.
        with np.errstate(over="ignore", invalid="ignore"):
            x = np.concatenate([present, wanted], axis=1).astype(np.float32)
            for inner_weight, inner_bias in hidden:
                x = np.maximum(x @ inner_weight + inner_bias, 0)
            return (x @ weight + bias).astype(np.float64)


def train_controller(config: ControllerConfig, demos: Demos, name: str, seed: int) -> Parameters:
    """Trains one controller, see `train_controllers`."""
    return train_controllers(config, [demos], name, [seed])[0]


def train_controllers(
    config: ControllerConfig,
    demos: Sequence[Demos],
    name: str,
    seeds: Sequence[int],
    start: Sequence[Parameters] = (),
) -> list[Parameters]:
    """Trains a controller for each seed and returns its weights after the last epoch.

    Controllers with as many samples as others train together, which does not change their weights.

    Args:
        config: layers and schedule.
        demos: for each seed, its demonstrations: hand motions are the inputs, actions the targets.
        name: name of the task, on which the random streams depend.
        seeds: seeds of the initial weights and the order of samples.
        start: for each seed, the weights that training starts from. Default: random weights.
    """
    found: dict[int, Parameters] = {}
    for count in dict.fromkeys(map(len, demos)):
        rows = [row for row, of_seed in enumerate(demos) if len(of_seed) == count]
        chosen = [seeds[row] for row in rows]
        begin = [start[row] for row in rows] if start else []
        trained = _train_together(config, [demos[row] for row in rows], name, chosen, begin)
        found |= dict(zip(rows, trained, strict=True))
    return [found[row] for row in range(len(demos))]


def _train_together(
    config: ControllerConfig,
    demos: Sequence[Demos],
    name: str,
    seeds: Sequence[int],
    start: Sequence[Parameters],
) -> Iterator[Parameters]:
    from methods.layers import mlp, mlp_weights
    from methods.training import Schedule, minimise

    robot_dim, action_dim = demos[0].velocities.shape[-1], demos[0].actions.shape[-1]
    widths = (2 * robot_dim, *(factor * robot_dim for factor in config.hidden), action_dim)
    trained = minimise(
        draw=lambda rng: mlp_weights(rng, "layer", widths),
        loss=lambda weights, x, u: (
            (mlp(weights, "layer", x, len(widths) - 1) - u).square().mean(dim=(1, 2))
        ),
        data=map(_samples, demos),
        schedule=Schedule(
            epochs=config.epochs,
            batch_size=config.batch_size,
            learning_rate=config.learning_rate,
        ),
        name=f"controller of {name}",
        seeds=seeds,
        start=start,
    )
    return (dict(one.weights) for one in trained)


def _samples(demos: Demos) -> tuple[FloatArray, FloatArray]:
    """Pairs of successive hand joints (N, 2 H), and actions (N, A)."""
    robot_dim, action_dim = demos.velocities.shape[-1], demos.actions.shape[-1]
    q = demos.states[:, :, :robot_dim]
    pairs = np.concatenate([q[:, :-1], q[:, 1:]], axis=-1)
    return pairs.reshape(-1, 2 * robot_dim), demos.actions.reshape(-1, action_dim)
