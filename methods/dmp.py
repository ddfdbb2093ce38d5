"""A DMP layer: dynamic movement primitives as a differentiable function of their parameters.

Each dimension follows a primitive of its own (as in neural dynamic policies, appendix E):

    s'  = -a_x s                                  canonical system, s = 1 at the start
    f   = s (g - y1) sum_i w_i psi_i(s) / sum_i psi_i(s)        forcing term
    y'' = alpha (beta (g - y) - y') + f

integrated with explicit Euler steps from y = y1, y' = v1. The motion is linear in y1, v1, g and the
products w_i (g - y1). So N_b + 3 basis motions, which are integrated once, replace the loop over
time in every forward and backward pass.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from torch import Tensor

from methods.layers import times
from tasks.data import FloatArray

WHITENING_FLOOR = 1e-6
"""Fraction of the largest singular value at which the whitening stops growing. Beyond it, weights
would become so large that float32 loses their differences."""
NEGLIGIBLE = 1e-30
"""Basis motions smaller than this are set to 0. In float32 they or their products would be
subnormal, which makes a matrix product ten times slower and changes no sum."""


@dataclass(frozen=True)
class DMPConfig:
    """Constants of the primitives. The defaults are those of neural dynamic policies."""

    basis_functions: int
    """N_b, number of radial basis functions of the forcing term."""
    steps: int
    """T - 1, number of integration steps."""
    dt: float
    """Length of a step, in units in which the motion takes about 1."""
    a_x: float = 1.0
    alpha: float = 25.0
    beta: float = 6.25
    """alpha / 4: critically damped."""
    start_velocity: float = 0.01
    """v1, in every dimension."""


def dmp(config: DMPConfig, start: Tensor, goal: Tensor, weights: Tensor) -> Tensor:
    """Returns the motions after their starts, (..., T-1, K).

    Args:
        config: the constants of the primitives.
        start: y1, (..., K).
        goal: g, (..., K).
        weights: w, (..., K, N_b).
    """
    of_start, of_goal, of_velocity, of_weights = (
        torch.from_numpy(basis).to(start) for basis in basis_motions(config)
    )
    forcing = (goal - start)[..., None] * weights
    return (
        start[..., None, :] * of_start[:, None]
        + goal[..., None, :] * of_goal[:, None]
        + config.start_velocity * of_velocity[:, None]
        + times(forcing, of_weights.T).transpose(-1, -2)
    )


@cache
def basis_motions(config: DMPConfig) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Returns the basis motions of start, goal, start velocity (T-1,) and weights (T-1, N_b)."""
    count = config.basis_functions
    activations = forcing_activations(config)
    # Columns: the motions of the start, the goal, the velocity and each basis function alone.
    y, v, g = (np.zeros(3 + count) for _ in range(3))
    y[0], g[1], v[2] = 1.0, 1.0, 1.0
    motions = np.empty((config.steps, 3 + count))
    for t, activation in enumerate(activations):
        forcing = np.concatenate([np.zeros(3), activation])
        acceleration = config.alpha * (config.beta * (g - y) - v) + forcing
        y, v = y + v * config.dt, v + acceleration * config.dt
        motions[t] = y
    motions[np.abs(motions) < NEGLIGIBLE] = 0.0
    return motions[:, 0], motions[:, 1], motions[:, 2], motions[:, 3:]


def forcing_activations(config: DMPConfig) -> FloatArray:
    """Returns s psi_i(s) / sum psi(s) at each step, (T-1, N_b)."""
    count = config.basis_functions
    centres = np.exp(-np.arange(count) / (count - 1))
    widths = count**1.5 / centres
    phase = (1 - config.a_x * config.dt) ** np.arange(1, config.steps + 1)
    psi = np.exp(-widths * (phase[:, None] - centres) ** 2)
    return phase[:, None] * psi / psi.sum(axis=1, keepdims=True)


@cache
def whitening(config: DMPConfig) -> FloatArray:
    """Returns a matrix (N_b, N_b) that turns numbers z of order 1 into weights w = z whitening.

    The basis motions of the weights are nearly linearly dependent: the singular values of 20 span
    ten decades. A gradient in w hardly changes motions that only small differences of basis motions
    express. Each number in z changes the motion about equally.
    """
    of_weights = basis_motions(config)[3]
    _, values, combinations = np.linalg.svd(of_weights, full_matrices=False)
    gains = len(of_weights) ** 0.5 / np.maximum(values, WHITENING_FLOOR * values[0])
    return np.asarray(combinations.T * gains @ combinations)
