"""NDP: a network that outputs the parameters of a DMP layer, which is a motion (appendix E)."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from methods.base import check_above
from methods.dmp import DMPConfig, dmp, whitening
from methods.layers import Weights, mlp, mlp_weights, times
from methods.network import NetworkConfig, NetworkMethod
from tasks.data import FloatArray
from tasks.errors import InputError


@dataclass(frozen=True, kw_only=True)
class NDPConfig(NetworkConfig):
    """Layers and basis functions are those of Table 4; the rest is chosen on validation data."""

    hidden: tuple[int, ...]
    basis_functions: int
    whole_state: bool = False
    """Whether the object's state also follows primitives."""
    goal_gain: float = 1.0
    """Factor of the goals that the network outputs."""
    weight_gain: float | None = None
    """Factor of the basis-function weights that the network outputs. Default: the matrix of
    `methods.dmp.whitening`."""
    dt: float | None = None
    """Length of a step. Default: 1 / (T-1), so that the phase spans the motion."""
    published_start: bool = False
    """Whether the layers are initialised as in the published code."""
    epochs: int = 300
    batch_size: int = 32
    learning_rate: float = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        check_above(self, 0, "hidden", "goal_gain")
        check_above(self, 1, "basis_functions")
        if self.weight_gain is not None:
            check_above(self, 0, "weight_gain")
        if self.dt is not None and not 0 < self.dt < 1:  # the phase would end after a step of 1
            raise InputError(f"dt must be above 0 and below 1, got {self.dt!r}")


class NDP(NetworkMethod):
    """Maps x(1) to a goal and N_b weights for each joint of the hand."""

    name = "ndp"
    version = 3
    summary = "dynamic movement primitives whose parameters a network gives"
    sizes: ClassVar[Mapping[str, NDPConfig]] = {
        "small": NDPConfig(hidden=(32, 64, 32), basis_functions=10),
        "median": NDPConfig(hidden=(64, 128, 64), basis_functions=20),
        "large": NDPConfig(hidden=(128, 256, 128), basis_functions=30),
    }
    default_size: ClassVar[Mapping[str, str]] = {
        "tool": "small",
        "door": "large",
        "relocation": "median",
        "reorientation": "median",
    }

    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "described": {},
        "published": {
            "whole_state": True,
            "goal_gain": 1000.0,
            "weight_gain": 1000.0,
            "dt": 0.01,
            "published_start": True,
            "standardise": False,
            "decay": False,
            "fresh_adam": "epoch",
            "epochs": 200,
            "batch_size": 4,
        },
    }

    @property
    def driven(self) -> int:
        """Number of state components that follow primitives: H, or all D."""
        return self.layout.state_dim if self.config.whole_state else self.layout.robot_dim

    def draw(self, rng: np.random.Generator) -> dict[str, FloatArray]:
        """Returns the layers from D inputs to a goal and N_b weights per driven component."""
        outputs = self.driven * (1 + self.config.basis_functions)
        widths = (self.layout.state_dim, *self.config.hidden, outputs)
        layers = _published_layers if self.config.published_start else mlp_weights
        return layers(rng, "layer", widths)

    def unroll(
        self, weights: Weights, start: Tensor, steps: int, truth: Tensor | None = None
    ) -> Tensor:
        """Returns the motion of the DMP layer."""
        config, driven = self.config, self.driven
        out = mlp(weights, "layer", start, len(config.hidden) + 1)
        goal, of_basis = out.split([driven, driven * config.basis_functions], dim=-1)
        of_basis = of_basis.unflatten(-1, (driven, config.basis_functions))
        dt = 1 / steps if config.dt is None else config.dt
        layer = DMPConfig(config.basis_functions, steps, dt)
        if config.weight_gain is None:
            of_basis = times(of_basis, torch.from_numpy(whitening(layer)).to(of_basis))
        else:
            of_basis = config.weight_gain * of_basis
        return dmp(layer, start[..., :driven], config.goal_gain * goal, of_basis)


def _published_layers(
    rng: np.random.Generator, name: str, widths: tuple[int, ...]
) -> dict[str, FloatArray]:
    """Hidden layers uniform within 1 / sqrt(outputs), biases 0.1; last orthogonal, biases 0."""
    *hidden, (inputs, outputs) = pairwise(widths)
    arrays: dict[str, FloatArray] = {}
    for i, (into, out) in enumerate(hidden):
        bound = out**-0.5
        arrays[f"{name}{i}.weight"] = rng.uniform(-bound, bound, (out, into))
        arrays[f"{name}{i}.bias"] = np.full(out, 0.1)
    stream = torch.Generator().manual_seed(int(rng.integers(2**63)))
    last = torch.empty((outputs, inputs), dtype=torch.float64)
    arrays[f"{name}{len(hidden)}.weight"] = nn.init.orthogonal_(last, generator=stream).numpy()
    arrays[f"{name}{len(hidden)}.bias"] = np.zeros(outputs)
    return arrays
