"""Lifting functions: the observables in which a Koopman operator is linear (appendix E, J).

The lifted state is phi(x) = [x_r, x_o, psi_r(x_r), psi_o(x_o)] (the paper's (8), reordered so that
the state comes first). Observables are chosen by the number of a set of appendix J, as a callable,
or by the import path ``"package.module:name"`` of a callable.
"""

from collections.abc import Callable
from functools import partial
from importlib import import_module

import numpy as np

from tasks.data import FloatArray, real
from tasks.errors import InputError, described, unknown_name

Observables = Callable[[FloatArray, FloatArray], FloatArray]
"""Maps x_r (..., H) and x_o (..., O) to the observables psi (..., Q) beyond the state."""


def lift(state: FloatArray, robot_dim: int, observables: Observables) -> FloatArray:
    """Returns the lifted states (..., p) of states x (..., D), p = D + Q.

    Raises:
        InputError: the observables do not have shape (..., Q), or states or observables are not
            real.
    """
    state = real("states", state)
    psi = real("observables", observables(state[..., :robot_dim], state[..., robot_dim:]))
    if psi.ndim != state.ndim or psi.shape[:-1] != state.shape[:-1]:
        raise InputError(
            f"observables of states {state.shape} must have shape {state.shape[:-1]} + (Q,),"
            f" got {psi.shape}"
        )
    return np.concatenate([state, psi], axis=-1)


def get_observables(chosen: int | str | Observables) -> Observables:
    """Returns the observables of a set number of appendix J or of an import path.

    A callable is returned unchanged.

    Raises:
        InputError: there is no such set, or no callable at the import path.
    """
    if callable(chosen):
        return chosen
    if isinstance(chosen, int):
        if chosen not in SETS:
            raise InputError(f"no observables have number {chosen}: choose from {list(SETS)}")
        return SETS[chosen]
    module, _, name = chosen.partition(":")
    try:
        found = import_module(module)
        observables = getattr(found, name, None)
    except BaseException as error:  # a module may raise anything, or call sys.exit
        raise InputError(
            f"observables {chosen!r}: cannot import {module!r}: {described(error)}; give a set"
            f" number from {list(SETS)} or 'package.module:name'"
        ) from error
    if not callable(observables):
        names = [other for other, value in vars(found).items() if callable(value)]
        raise unknown_name(f"function of {module}", name, names)
    return observables


def squares(x: FloatArray) -> FloatArray:
    """Returns x_i^2, (..., n)."""
    return x**2


def products(x: FloatArray) -> FloatArray:
    """Returns x_i x_j for i <= j, (..., n (n + 1) / 2)."""
    i, j = np.triu_indices(x.shape[-1])
    return x[..., i] * x[..., j]


def cubes(x: FloatArray) -> FloatArray:
    """Returns x_i^3, (..., n)."""
    return x**3


def squares_times(x: FloatArray) -> FloatArray:
    """Returns x_i^2 x_j for all ordered pairs i, j, (..., n^2)."""
    return (x[..., :, None] ** 2 * x[..., None, :]).reshape(*x.shape[:-1], -1)


_Parts = tuple[Callable[[FloatArray], FloatArray], ...]


def _polynomials(robot: _Parts, of_object: _Parts, x_r: FloatArray, x_o: FloatArray) -> FloatArray:
    parts = [psi(x_r) for psi in robot] + [psi(x_o) for psi in of_object]
    return np.concatenate(parts, axis=-1)


SETS: dict[int, Observables] = {
    1: partial(_polynomials, (squares,), (squares,)),
    2: partial(_polynomials, (products,), (products,)),
    3: partial(_polynomials, (products, cubes), (products, squares_times)),
    4: partial(_polynomials, (products, squares_times), (products, squares_times)),
}
"""The four sets of appendix J, Table 11. The third is appendix (11)."""
