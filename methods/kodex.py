"""KODex: a Koopman operator as the model of a manipulation skill (appendix A, E).

The lifted state phi(x) evolves linearly, z(t+1) = K z(t). K = A pinv(G) is the least-squares
solution over all pairs of successive states in the demonstrations (the paper's (9)):

    A = 1/M sum phi(x(t+1)) phi(x(t))^T,    G = 1/M sum phi(x(t)) phi(x(t))^T.

With the pairs as rows of Z and Z', this is K = (pinv(Z) Z')^T. `solve_koopman` takes pinv(Z) from
an orthogonal decomposition of Z. To form G first would square the condition number, and leave
directions of Z to rounding.

Nothing in it is random: the seed decides only which demonstrations it learns from.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import scipy.linalg
from threadpoolctl import threadpool_limits

from methods.base import MotionMethod, NotFittedError, Parameters
from methods.lifting import get_observables, lift
from methods.scale import Scale
from tasks.data import Demos, FloatArray, Layout, real
from tasks.errors import InputError


@dataclass(frozen=True)
class KodexConfig:
    """The settings of KODex. What the appendix leaves open is chosen on validation data.

    Raises:
        InputError: a value is out of range.
    """

    observables: int | str = 3
    """Number of a set of appendix J, or the import path ``"package.module:name"`` of a function."""
    cutoff: float = 1e9
    """Multiple of p eps, relative to the largest, below which a singular value of the lifted states
    counts as zero."""
    standardise: bool = True
    """Whether states are scaled to mean 0 and standard deviation 1 before they are lifted."""
    constant: bool = True
    """Whether 1 is one more observable, so that the lifted state can move by an offset."""
    normal_equations: bool = False
    """Whether K comes from G, as in the published code; `cutoff` then speaks of G."""

    def __post_init__(self) -> None:
        if isinstance(self.observables, int):
            get_observables(self.observables)
        if not self.cutoff >= 0:
            raise InputError(f"cutoff must be 0 or more, got {self.cutoff!r}")


RAW = {"standardise": False, "constant": False, "cutoff": 1.0}
"""Lifted states as appendix J lists them, of which nothing but rounding is cut off."""
LIFTING_VARIANTS = ("described", "set_1", "set_2", "set_4")
"""The variants with different sets of observables. ``described`` has the third set."""


class Kodex(MotionMethod):
    """Predicts motions with the Koopman operator K, (p, p)."""

    name = "kodex"
    summary = "Koopman operator on polynomial observables"
    replans = True
    version = 2
    sizes: ClassVar[Mapping[str, KodexConfig]] = {"single": KodexConfig()}
    default_size: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("tool", "door", "relocation", "reorientation"), "single"
    )
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "described": {},
        "set_1": {"observables": 1},
        "set_2": {"observables": 2},
        "set_4": {"observables": 4},
        "uncut": {"cutoff": 1.0},
        "raw": RAW,
        "published": {**RAW, "normal_equations": True},
    }

    def __init__(self, config: KodexConfig, layout: Layout) -> None:
        super().__init__(config, layout)
        self._observables = get_observables(config.observables)
        self._koopman: FloatArray | None = None
        self._scale = Scale(np.zeros(layout.state_dim), np.ones(layout.state_dim))
        self._readouts: FloatArray | None = None
        self._of_fit: Parameters = {}

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
        self._scale = Scale.of(demos.states, self.config.standardise)
        lifted = self._lift(demos.states)
        before, after = (_flat(lifted[:, rows]) for rows in (slice(None, -1), slice(1, None)))
        solve = solve_normal_equations if self.config.normal_equations else solve_koopman
        # On one thread sums have the same order everywhere.
        with threadpool_limits(1, "blas"):
            solution = solve(before, after, self.config.cutoff)
            states = slice(0, self.layout.state_dim)
            errors = np.abs(before @ solution.koopman[states].T - after[:, states])
        self._koopman, self._readouts = solution.koopman, None
        self._of_fit = {
            "one_step_residuals": errors.mean(axis=0) * self._scale.scale,
            "singular_values": solution.singular_values,
            "rank": np.array(solution.rank),
        }

    def parameters(self) -> Parameters:
        """Returns K and the scaling of states."""
        return {"koopman": self.koopman, **self._scale.arrays()}

    def load(self, parameters: Parameters) -> None:
        """Restores K and the scaling of states."""
        self._koopman = parameters["koopman"]
        self._scale = Scale.of_arrays(parameters)
        self._readouts, self._of_fit = None, {}

    def rollout(self, start: FloatArray, steps: int) -> FloatArray:
        """Returns the states x in z(t+1) = K z(t), (B, steps + 1, D). Only the start is lifted."""
        with threadpool_limits(1, "blas"):
            predicted = self._lift(start) @ self._read_out(steps).T
        predicted = predicted.reshape(len(start), steps, self.layout.state_dim)
        return np.concatenate([start[:, None], self._scale.undo(predicted)], axis=1)

    def diagnostics(self) -> Parameters:
        """Returns the spectrum of K and, after a fit, what it was solved from.

        ``eigenvalues`` (p, 2) holds real and imaginary parts (Fig. 7, Table 12),
        ``one_step_residuals`` (D,) the mean absolute errors of x(t+1) predicted from phi(x(t)),
        ``singular_values`` (p,) those of the lifted states, the largest first, and ``rank`` () how
        many of them count. K hangs little on the cut-off if the next one is much smaller.
        """
        with threadpool_limits(1, "blas"):
            values = scipy.linalg.eigvals(self.koopman)
        return {"eigenvalues": np.stack([values.real, values.imag], axis=-1), **self._of_fit}

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
        lifted = lift(self._scale.apply(state), self.layout.robot_dim, self._observables)
        if not self.config.constant:
            return lifted
        return np.concatenate([lifted, np.ones((*lifted.shape[:-1], 1))], axis=-1)


class Solution(NamedTuple):
    """A Koopman operator, and the singular values that decided which directions it heeds."""

    koopman: FloatArray
    """K, (p, p)."""
    singular_values: FloatArray
    """Of the lifted states before, (p,), the largest first."""
    rank: int
    """How many of them count."""


def solve_koopman(before: FloatArray, after: FloatArray, cutoff: float = 1.0) -> Solution:
    """Returns K = A pinv(G) (the paper's (9)) from lifted pairs (M, p) and (M, p).

    It is solved by QR, and the SVD of R. Singular values of R, which are those of the lifted states
    ``before``, count as zero below cutoff * p * eps times the largest.

    Raises:
        InputError: the pairs are not real, or not two arrays of one shape (M, p).
    """
    before, after = _pairs(before, after)
    projected, triangle = scipy.linalg.qr_multiply(before, after.T, mode="right")
    left, values, right = scipy.linalg.svd(triangle, full_matrices=False)
    kept = values > _smallest(values, before.shape[1], cutoff)
    koopman = projected @ (left[:, kept] / values[kept]) @ right[kept]
    return Solution(koopman, values, int(kept.sum()))


def solve_normal_equations(before: FloatArray, after: FloatArray, cutoff: float = 1.0) -> Solution:
    """Returns the same from A and G, as the published code does.

    The singular values of G are the squares of those of the lifted states, over M. Those below
    cutoff * p * eps times the largest count as zero.

    Raises:
        InputError: as `solve_koopman`.
    """
    before, after = _pairs(before, after)
    pairs = len(before)
    a = after.T @ before / pairs
    g = before.T @ before / pairs
    values, vectors = scipy.linalg.eigh(g)
    kept = values > _smallest(values, len(g), cutoff)
    koopman = a @ (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
    return Solution(koopman, np.sqrt(pairs * np.abs(values[::-1])), int(kept.sum()))


def _pairs(before: FloatArray, after: FloatArray) -> tuple[FloatArray, FloatArray]:
    before, after = real("states before", before), real("states after", after)
    if before.ndim != 2 or before.shape != after.shape:
        raise InputError(f"pairs are two arrays (M, p), got {before.shape} and {after.shape}")
    return before, after


def _smallest(values: FloatArray, observables: int, cutoff: float) -> float:
    """The singular value up to which all count as zero."""
    return float(cutoff * observables * np.finfo(np.float64).eps * values.max())


def _flat(lifted: FloatArray) -> FloatArray:
    return lifted.reshape(-1, lifted.shape[-1])
