"""Regression: the whole motion as a polynomial of its start. The line that a method has to beat.

Ridge regression maps the monomials of x(1) up to a degree, centred and each of variance 1, to
x(2..T). Between the starts of a task only a few numbers of x(1) differ; the others give no
monomials.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import ClassVar

import numpy as np
import scipy.linalg
from threadpoolctl import threadpool_limits

from methods.base import MotionMethod, NotFittedError, Parameters, check_above
from methods.scale import Scale
from tasks.data import Demos, FloatArray, IntArray
from tasks.errors import InputError

VARIES = 1e-9
"""Standard deviation of a component of x(1) above which it varies between starts."""


@dataclass(frozen=True)
class RegressionConfig:
    """The settings of the regression.

    Raises:
        InputError: a value is out of range.
    """

    degree: int = 2
    """The highest degree that is tried. The one with the lowest validation error, of standardised
    states, is kept."""
    ridge: float = 1e-4
    """Weight of the squared coefficients, for each demonstration."""

    def __post_init__(self) -> None:
        check_above(self, 0, "degree", "ridge")
        if self.degree > 3:
            raise InputError(f"degree must be 1, 2 or 3, got {self.degree}")


class Regression(MotionMethod):
    """x(2..T) = mean + coefficients times monomials of x(1)."""

    name = "regression"
    version = 2
    summary = "ridge regression from the start to the whole motion"
    sizes: ClassVar[Mapping[str, RegressionConfig]] = {"single": RegressionConfig()}
    default_size: ClassVar[Mapping[str, str]] = {}
    validates = True

    _arrays: Parameters | None = None

    def fit(self, demos: Demos, validation: Demos, seed: int) -> None:
        """Keeps the degree with the lowest validation error. The seed has no effect."""
        scale, errors = Scale.of(demos.states, standardise=True), []
        wanted = scale.apply(validation.states)
        fits = [self._solve(demos, degree) for degree in range(1, self.config.degree + 1)]
        for arrays in fits:
            self._arrays = arrays
            predicted = self.rollout(validation.states[:, 0], validation.states.shape[1] - 1)
            errors.append(np.square(scale.apply(predicted) - wanted).mean())
        self._arrays = fits[int(np.argmin(errors))]

    def parameters(self) -> Parameters:
        """Returns the coefficients and what centres and scales the monomials."""
        if self._arrays is None:
            raise NotFittedError("this regression has no coefficients yet: call fit or load")
        return self._arrays

    def load(self, parameters: Parameters) -> None:
        """Restores the coefficients and what centres and scales the monomials."""
        self._arrays = dict(parameters)

    def rollout(self, start: FloatArray, steps: int) -> FloatArray:
        """Returns the motion from each start, (B, steps + 1, D)."""
        arrays = self.parameters()
        inputs = _monomials(start, arrays) - arrays["monomial_mean"]
        with threadpool_limits(1, "blas"):
            found = (inputs / arrays["monomial_scale"]) @ arrays["coefficients"]
        motion = (arrays["motion_mean"] + found).reshape(len(start), -1, self.layout.state_dim)
        return _from_start(start, motion, steps)

    def _solve(self, demos: Demos, degree: int) -> Parameters:
        starts, motions = demos.states[:, 0], demos.states[:, 1:].reshape(len(demos), -1)
        varying = np.flatnonzero(starts.std(axis=0) > VARIES)
        arrays: Parameters = {
            "degree": np.array(degree),
            "varying": varying,
            "start_mean": starts[:, varying].mean(axis=0),
            "start_scale": starts[:, varying].std(axis=0),
            "motion_mean": motions.mean(axis=0),
        }
        inputs = _monomials(starts, arrays)
        arrays["monomial_mean"] = inputs.mean(axis=0)
        arrays["monomial_scale"] = np.maximum(inputs.std(axis=0), VARIES)
        inputs = (inputs - arrays["monomial_mean"]) / arrays["monomial_scale"]
        with threadpool_limits(1, "blas"):
            # With fewer demonstrations than monomials, the dual problem is the smaller one.
            gram = inputs @ inputs.T + self.config.ridge * len(demos) * np.eye(len(demos))
            weights = scipy.linalg.solve(gram, motions - arrays["motion_mean"], assume_a="pos")
            arrays["coefficients"] = inputs.T @ weights
        return arrays


def _monomials(starts: FloatArray, arrays: Parameters) -> FloatArray:
    """Returns the products of up to `degree` standardised components that vary, (B, P)."""
    varying: IntArray = arrays["varying"]
    x = (starts[:, varying] - arrays["start_mean"]) / arrays["start_scale"]
    places = [
        list(chosen)
        for degree in range(1, int(arrays["degree"]) + 1)
        for chosen in combinations_with_replacement(range(x.shape[1]), degree)
    ]
    columns = [x[:, chosen].prod(axis=1) for chosen in places]
    return np.stack(columns, axis=1) if columns else np.zeros((len(x), 0))


def _from_start(start: FloatArray, motion: FloatArray, steps: int) -> FloatArray:
    """Returns starts (B, D) and a number of states of motions (B, T - 1, D) after them.

    A motion that is shorter rests at its end.
    """
    kept = motion[:, np.minimum(np.arange(steps), motion.shape[1] - 1)]
    return np.concatenate([start[:, None], kept], axis=1)
