"""NGF: a neural geometric fabric, a second-order policy in configuration space (appendix E).

With q the joints, v their velocity and c = x(1) the context, all standardised, a motion obeys

    v' = p_e W pi + (1 - W) pi_f - b v,        q' = v,        v(1) = 0,

    geometry     pi   = |v|^2 / H a(q, c)      homogeneous of degree 2 in v
    potential    pi_f = -grad_q Psi(q, c),     Psi = 1/2 |k q + u(q, c)|^2
    energising   p_e  = I - v v^T / |v|^2
    metrics      W    = M / (M + M_f),         M(q, c), M_f(q, c) diagonal and positive
    damping      b(q, v, c) >= 0

The metrics weigh geometry against potential, joint by joint. p_e projects the whole geometry term,
so the fabric alone (pi_f = 0, b = 0) bends the path and conserves the kinetic energy 1/2 |v|^2.
Since 1 - W > 0, a motion can rest only where the gradient of Psi vanishes. [M, a], M_f, u and b are
networks of the listed size with tanh layers. Time is in seconds; integration is semi-implicit Euler
with steps of one control step.

Training uses windows of a few steps, each from the joints and the velocity of the demonstration at
that point. Backpropagation through all T steps takes longer and learns less (docs/methods.md).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from methods.base import check_above
from methods.layers import Weights, linear, linear_weights, sigmoid, softplus
from methods.network import NetworkConfig, NetworkMethod, windows
from methods.ngf_gradient import AT_REST, NETWORKS, motion_with_gradient
from tasks.data import CONTROL_STEP, FloatArray
from tasks.product import product


@dataclass(frozen=True, kw_only=True)
class NGFConfig(NetworkConfig):
    """Layers are those of Table 5; the rest is chosen on validation data."""

    hidden: tuple[int, int]
    window: int = 10
    """Number of steps of a window in training."""
    stiffness: float = 10.0
    """Initial value of k."""
    damping: float = 2.0
    """Initial b, as a multiple of k. Critical for a pull of k^2 q is 2; for the pull of the first
    motions, which the weight 1 - W of about one half takes, the square root of 2."""
    epochs: int = 20
    batch_size: int = 32
    learning_rate: float = 4e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        check_above(self, 0, "hidden", "window", "stiffness", "damping")


class NGF(NetworkMethod):
    """The fabric, integrated from rest at x(1)."""

    name = "ngf"
    summary = "geometric fabric: energised geometry, potential and damping"
    version = 4
    sizes: ClassVar[Mapping[str, NGFConfig]] = {
        "small": NGFConfig(hidden=(64, 32)),
        "median": NGFConfig(hidden=(128, 64)),
        "large": NGFConfig(hidden=(256, 128)),
    }
    default_size: ClassVar[Mapping[str, str]] = {
        "tool": "large",
        "door": "median",
        "relocation": "small",
        "reorientation": "small",
    }

    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {"described": {}, "published": {}}

    def draw(self, rng: np.random.Generator) -> dict[str, FloatArray]:
        """Returns the four networks and the stiffness."""
        joints = self.layout.robot_dim
        arrays = {"stiffness": np.full(joints, self.config.stiffness)}
        for name, moving, outputs in (
            ("geometry", joints, 2 * joints),
            ("metric", joints, joints),
            ("potential", joints, joints),
            ("damping", 2 * joints, 1),
        ):
            first, second = self.config.hidden
            arrays |= linear_weights(rng, f"{name}_context", self.layout.state_dim, first)
            arrays |= linear_weights(rng, f"{name}0", moving, first)
            arrays |= linear_weights(rng, f"{name}1", first, second)
            arrays |= linear_weights(rng, f"{name}2", second, outputs)
        # With much less than critical damping, motions oscillate at first.
        arrays["damping2.bias"] += self.config.damping * self.config.stiffness
        return arrays

    def unroll(
        self, weights: Weights, start: Tensor, steps: int, truth: Tensor | None = None
    ) -> Tensor:
        """Returns the joints after each step."""
        q = start[..., : self.layout.robot_dim]
        return integrate(weights, start, q, torch.zeros_like(q), steps)

    def samples(self, states: FloatArray) -> list[FloatArray]:
        """Returns contexts (N, D) and windows (N, 1 + W + 1, H) of joints."""
        joints = states[..., : self.layout.robot_dim]
        at_rest = np.concatenate([joints[:, :1], joints], axis=1)
        steps = min(self.config.window, states.shape[1] - 1)
        found = windows(at_rest, steps + 1)
        return [np.repeat(states[:, 0], len(found) // len(states), axis=0), found]

    def loss(self, weights: Weights, *sample: Tensor) -> Tensor:
        """Returns the mean squared error on windows, each predicted from its first two rows."""
        context, window = sample
        q = window[:, :, 1]
        v = (q - window[:, :, 0]) / CONTROL_STEP
        predicted = motion_with_gradient(weights, context, q, v, window.shape[2] - 2)
        return (predicted - window[:, :, 2:]).square().mean(dim=(1, 2, 3))


def integrate(weights: Weights, context: Tensor, q: Tensor, v: Tensor, steps: int) -> Tensor:
    """Returns the joints after each step, see `methods.ngf_gradient.motion_with_gradient`."""
    of_context = {name: linear(weights, f"{name}_context", context) for name in NETWORKS}
    motion = []
    for _ in range(steps):
        v = v + CONTROL_STEP * acceleration(weights, of_context, q, v)
        q = q + CONTROL_STEP * v
        motion.append(q)
    return torch.stack(motion, dim=2)


def acceleration(weights: Weights, context: Mapping[str, Tensor], q: Tensor, v: Tensor) -> Tensor:
    """Returns v' (S, B, H). ``context`` holds the contribution of c to each first layer."""
    bend, weight = _network(weights, "geometry", context, q).chunk(2, dim=-1)
    share = sigmoid(weight - _network(weights, "metric", context, q))
    geometry = energised(share * bend * v.square().mean(dim=-1, keepdim=True), v)
    pull = -potential_gradient(weights, context["potential"], q)
    damping = softplus(_network(weights, "damping", context, torch.cat([q, v], dim=-1)))
    return geometry + (1 - share) * pull - damping * v


def energised(force: Tensor, v: Tensor) -> Tensor:
    """Returns p_e force: the part of a force that does no work along the motion."""
    along = (force * v).sum(dim=-1, keepdim=True)
    return force - v * along / (v.square().sum(dim=-1, keepdim=True) + AT_REST)


def potential_gradient(weights: Weights, context: Tensor, q: Tensor) -> Tensor:
    """Returns grad_q Psi (S, B, H), written out so that it costs no more than Psi."""
    first = torch.tanh(linear(weights, "potential0", q) + context)
    second = torch.tanh(linear(weights, "potential1", first))
    stiffness = weights["stiffness"][:, None]
    residual = stiffness * q + linear(weights, "potential2", second)
    back = product(residual, weights["potential2.weight"]) * (1 - second.square())
    back = product(back, weights["potential1.weight"]) * (1 - first.square())
    return stiffness * residual + product(back, weights["potential0.weight"])


def _network(weights: Weights, name: str, context: Mapping[str, Tensor], x: Tensor) -> Tensor:
    first = torch.tanh(linear(weights, f"{name}0", x) + context[name])
    return linear(weights, f"{name}2", torch.tanh(linear(weights, f"{name}1", first)))
