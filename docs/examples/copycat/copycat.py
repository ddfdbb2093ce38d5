"""Copycat: does in each state what was demonstrated in the nearest one; the least closed loop."""

from dataclasses import dataclass

import numpy as np

from methods.base import ActionMethod, NotFittedError


@dataclass(frozen=True)
class CopycatConfig:
    """There is nothing to choose."""


class Copycat(ActionMethod):
    """Returns the action taken in the nearest standardised state."""

    name = "copycat"
    summary = "action of the nearest demonstrated state"
    sizes = {"single": CopycatConfig()}
    default_size = {}

    _learnt = None

    def fit(self, demos, validation, seed):
        """Stores the pairs of state x(t) and action u(t), t = 1..T-1, and how to scale states."""
        states = demos.states[:, :-1].reshape(-1, self.layout.state_dim)
        scale = np.maximum(states.std(axis=0), 1e-2)
        actions = demos.actions.reshape(len(states), -1)
        self._learnt = {"states": states / scale, "actions": actions, "scale": scale}

    def parameters(self):
        """Returns what `fit` stored."""
        if self._learnt is None:
            raise NotFittedError("call fit or load first")
        return self._learnt

    def load(self, parameters):
        """Takes what `parameters` returned."""
        self._learnt = dict(parameters)

    def reset(self, starts, rngs):
        """Has nothing to remember of an episode, and draws nothing."""

    def act(self, state, t):
        """Returns actions (B, A) for states (B, D)."""
        learnt = self.parameters()
        states = learnt["states"]
        # |a - b|^2, but for |a|^2, which is the same for all b
        apart = (states**2).sum(axis=1) - 2 * (state / learnt["scale"]) @ states.T
        return learnt["actions"][apart.argmin(axis=1)]
