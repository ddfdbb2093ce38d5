"""KODex: a Koopman operator as the model of a manipulation skill (appendix A, E).

The lifted state phi(x) evolves linearly, z(t+1) = K z(t). K = A pinv(G) is the least-squares
solution over all pairs of successive states in the demonstrations (appendix (9)):

    A = 1/M sum phi(x(t+1)) phi(x(t))^T,    G = 1/M sum phi(x(t)) phi(x(t))^T.

Nothing in it is random, and only the observables can be tuned.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.linalg
from threadpoolctl import threadpool_limits

from methods.base import MotionMethod, NotFittedError, Parameters
from methods.lifting import get_observables, lift
from tasks.data import Demos, FloatArray, Layout, real
from tasks.errors import InputError


@dataclass(frozen=True)
class KodexConfig:
    """The settings of KODex.

    Raises:
        InputError: the cutoff is below 0.
    """

    observables: int | str = 3
    """Number of a set of appendix J, or the import path ``"package.module:name"`` of a function."""
    cutoff: float = 1.0
    """Multiple of p eps, relative to the largest singular value of G, below which pinv(G) treats
    singular values as zero."""

    def __post_init__(self) -> None:
        if not self.cutoff >= 0:
            raise InputError(f"cutoff must be 0 or more, got {self.cutoff!r}")


LIFTING_VARIANTS = ("described", "set_1", "set_2", "set_4")
"""The variants with different sets of observables. ``described`` has the third set."""


class Kodex(MotionMethod):
    """Predicts motions with the Koopman operator K, (p, p)."""

    name = "kodex"
    summary = "Koopman operator on polynomial observables"
    sizes: ClassVar[Mapping[str, KodexConfig]] = {"single": KodexConfig()}
    default_size: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("tool", "door", "relocation", "reorientation"), "single"
    )
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "described": {},
        "set_1": {"observables": 1},
        "set_2": {"observables": 2},
        "set_4": {"observables": 4},
        "cutoff_tenfold": {"cutoff": 10.0},
        "cutoff_tenth": {"cutoff": 0.1},
    }
    deterministic = True

    def __init__(self, config: KodexConfig, layout: Layout) -> None:
        super().__init__(config, layout)
        self._observables = get_observables(config.observables)
        self._koopman: FloatArray | None = None
        self._readouts: FloatArray | None = None
        self._residuals: FloatArray | None = None

    @property
    def koopman(self) -> FloatArray:
        """The Koopman operator K, (p, p).

        Raises:
            NotFittedError: neither `fit` nor `load` was called.
        """
        if self._koopman is None:
            raise NotFittedError("this KODex has no K yet: call fit or load")
        return self._koopman

    def fit(self, demos: Demos, validation: Demos, seed: int) -> None:
        """Solves for K. Validation demonstrations and seed have no effect."""
        lifted = self._lift(demos.states)
        before, after = (_flat(lifted[:, rows]) for rows in (slice(None, -1), slice(1, None)))
        # G has no clear gap between signal and noise, so K depends on the order of summation. One
        # thread gives the same order everywhere.
        with threadpool_limits(1, "blas"):
            koopman = solve_koopman(before, after, self.config.cutoff)
            states = slice(0, self.layout.state_dim)
            errors = np.abs(before @ koopman[states].T - after[:, states])
        self.load({"koopman": koopman})
        self._residuals = errors.mean(axis=0)

    def parameters(self) -> Parameters:
        """Returns K."""
        return {"koopman": self.koopman}

    def load(self, parameters: Parameters) -> None:
        """Restores K."""
        self._koopman = parameters["koopman"]
        self._readouts = self._residuals = None

    def rollout(self, start: FloatArray, steps: int) -> FloatArray:
        """Returns the states x in z(t+1) = K z(t), (B, steps + 1, D). Only the start is lifted."""
        with threadpool_limits(1, "blas"):
            predicted = self._lift(start) @ self._read_out(steps).T
        predicted = predicted.reshape(len(start), steps, self.layout.state_dim)
        return np.concatenate([start[:, None], predicted], axis=1)

    def diagnostics(self) -> Parameters:
        """Returns the spectrum of K and, after a fit, the residuals on the training pairs.

        ``eigenvalues`` (p, 2) holds real and imaginary parts (Fig. 7, Table 12),
        ``one_step_residuals`` (D,) the mean absolute errors of x(t+1) predicted from phi(x(t)).
        """
        with threadpool_limits(1, "blas"):
            values = scipy.linalg.eigvals(self.koopman)
        found = {"eigenvalues": np.stack([values.real, values.imag], axis=-1)}
        if self._residuals is not None:
            found["one_step_residuals"] = self._residuals
        return found

    def _read_out(self, steps: int) -> FloatArray:
        """The rows of K, K^2, ..., K^steps that give x, (steps D, p).

        They are computed once for all starts. Multiplying each lifted state by K costs far more.
        """
        dim = self.layout.state_dim
        if self._readouts is None or len(self._readouts) < steps * dim:
            rows = np.empty((steps, dim, len(self.koopman)))
            rows[0] = self.koopman[:dim]
            for t in range(1, steps):
                rows[t] = rows[t - 1] @ self.koopman
            self._readouts = rows.reshape(steps * dim, -1)
        return self._readouts[: steps * dim]

    def _lift(self, state: FloatArray) -> FloatArray:
        return lift(state, self.layout.robot_dim, self._observables)


def solve_koopman(before: FloatArray, after: FloatArray, cutoff: float = 1.0) -> FloatArray:
    """Returns K = A pinv(G), (p, p), from lifted pairs (M, p) and (M, p) (appendix (9)).

    Singular values of G below cutoff * p * eps times the largest count as zero. NumPy's smaller
    default would keep directions that are rounding errors.

    Raises:
        InputError: the pairs are not real, or not two arrays of one shape (M, p).
    """
    before, after = real("states before", before), real("states after", after)
    if before.ndim != 2 or before.shape != after.shape:
        raise InputError(f"pairs are two arrays (M, p), got {before.shape} and {after.shape}")
    pairs, observables = before.shape
    a = after.T @ before / pairs
    g = before.T @ before / pairs
    # G is symmetric and positive semidefinite, so its eigenvalues are its singular values.
    inverse = scipy.linalg.pinvh(g, rtol=cutoff * observables * np.finfo(np.float64).eps)
    return a @ inverse


def _flat(lifted: FloatArray) -> FloatArray:
    return lifted.reshape(-1, lifted.shape[-1])
