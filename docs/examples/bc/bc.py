"""BC: behaviour cloning, an MLP from each state to the expert's action there."""

from dataclasses import dataclass

import numpy as np
import torch

from methods.base import ActionMethod, NotFittedError
from methods.layers import mlp, mlp_weights, tensor
from methods.training import Schedule, minimise, one_thread


@dataclass(frozen=True, kw_only=True)
class BCConfig(Schedule):
    """Layers, and how they are trained: nothing was tuned."""

    hidden: tuple[int, ...]
    epochs: int = 50
    batch_size: int = 128
    learning_rate: float = 1e-3
    decay: bool = True


class BC(ActionMethod):
    """u(t) = MLP(x(t)), the mean squared error of the actions minimised."""

    name = "bc"
    summary = "behaviour cloning, state to action"
    sizes = {"small": BCConfig(hidden=(64, 64)), "large": BCConfig(hidden=(256, 256))}
    default_size = {}
    validates = True

    _arrays = None

    def fit(self, demos, validation, seed):
        """Learns from all pairs of state x(t) and action u(t), t = 1..T-1."""
        mean, scale = demos.states.mean((0, 1)), np.maximum(demos.states.std((0, 1)), 1e-2)
        depth = len(self.config.hidden) + 1
        widths = (self.layout.state_dim, *self.config.hidden, self.layout.action_dim)

        def pairs(some):
            x = (some.states[:, :-1] - mean) / scale
            return x.reshape(-1, widths[0]), some.actions.reshape(-1, widths[-1])

        def loss(weights, x, u):
            return (mlp(weights, "layer", x, depth) - u).square().mean(dim=(1, 2))

        unseen = [tensor(array) for array in pairs(validation)]
        (trained,) = minimise(
            draw=lambda rng: mlp_weights(rng, "layer", widths),
            loss=loss,
            data=[pairs(demos)],
            schedule=self.config,
            name=self.name,
            seeds=[seed],
            validate=lambda weights: loss(weights, *(array[None] for array in unseen)),
        )
        self._arrays = trained.weights | {"state_mean": mean, "state_scale": scale}

    def parameters(self):
        """Returns weights and the scaling of states."""
        if self._arrays is None:
            raise NotFittedError("call fit or load first")
        return self._arrays

    def load(self, parameters):
        """Takes what `parameters` returned."""
        self._arrays = dict(parameters)

    def reset(self, starts):
        """Has nothing to remember of an episode."""

    def act(self, state, t):
        """Returns actions (B, A) for states (B, D)."""
        arrays = self.parameters()
        x = (state - arrays["state_mean"]) / arrays["state_scale"]
        weights = {
            name: tensor(array)[None] for name, array in arrays.items() if name.startswith("layer")
        }
        with one_thread(), torch.no_grad():
            u = mlp(weights, "layer", tensor(x)[None], len(weights) // 2)
        return np.clip(u[0].numpy(), -1, 1)
