"""Calls methods and checks what they return, in a check and in a run alike.

Parameters and diagnostics become bytes, answers become new float64 arrays. No object that a method
returned leaves this file.
"""

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from itertools import chain
from types import NoneType
from typing import Any

import numpy as np

from methods.base import ActionMethod, Method, MotionMethod, NotFittedError, machine_fields
from tasks.data import Demos, FloatArray, Layout
from tasks.errors import InputError, described
from tasks.files import from_bytes, to_bytes

MAX_BYTES = 2**30
"""Largest size of a fit's parameters, and of its diagnostics."""


class ContractError(InputError):
    """A method broke its contract; the message says how."""


@contextmanager
def _calling(function: str, when: str = "") -> Iterator[None]:
    """Turns an error of a method's function into a ContractError with the function and the line.

    NotFittedError and KeyboardInterrupt pass.
    """
    try:
        yield
    except (ContractError, NotFittedError):
        raise
    except (Exception, SystemExit) as error:
        raise ContractError(f"{function} raised {described(error)}{when}") from error


def resolved(config: Any) -> dict[str, Any]:
    """Returns the fields of a config by name, as JSON stores them.

    Raises:
        ContractError: JSON cannot store a value, or the stored config would differ.
    """
    given = {field.name: getattr(config, field.name) for field in fields(config) if field.init}
    odd = {name: value for name, value in given.items() if not _is_plain(value)}
    if odd:
        raise ContractError(
            f"{odd} cannot be stored: fields of a config must be finite numbers, texts, truth"
            " values, None or tuples of them"
        )
    values: dict[str, Any] = json.loads(json.dumps(given))
    if from_json(type(config), values) != config:
        raise ContractError(f"{config!r} is not the same once stored and built again")
    return values


def _is_plain(value: Any) -> bool:
    if type(value) is tuple:
        return all(map(_is_plain, value))
    return type(value) in (bool, int, str, NoneType) or (
        type(value) is float and math.isfinite(value)
    )


def from_json(kind: type[Any], values: Mapping[str, Any]) -> Any:
    """Returns the config of a class from values that `resolved` returned.

    Fields that `methods.base.machine_fields` names may be missing. They then have their defaults.

    Raises:
        ContractError: the values belong to a config with other fields.
    """
    expected = {field.name for field in fields(kind) if field.init}
    if expected != set(values) | machine_fields(kind):
        raise ContractError(f"a config with {sorted(expected)} cannot have {sorted(values)}")
    return kind(**{name: _tuples(value) for name, value in values.items()})


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list | tuple) else value


def build(method: type[Method], values: Mapping[str, Any], layout: Layout) -> Method:
    """Returns an unfitted method with the values of a config.

    Raises:
        InputError: the method does not accept the config.
    """
    return method(from_json(type(next(iter(method.sizes.values()))), values), layout)


@dataclass(frozen=True)
class Learnt:
    """What a method learnt with one seed, as bytes for a file."""

    parameters: bytes
    diagnostics: bytes
    method: Method
    """A new object that has loaded the parameters, as in an evaluation."""


def learn(
    method: type[Method],
    values: Mapping[str, Any],
    layout: Layout,
    demos: Sequence[Demos],
    validation: Sequence[Demos],
    seeds: Sequence[int],
) -> list[Learnt]:
    """Fits a method to demonstrations, once for each seed.

    Args:
        method: the method's class.
        values: the values of its config, as `resolved` returns them.
        layout: the dimensions of the task.
        demos: for each seed, its training demonstrations.
        validation: for each seed, other demonstrations, for choosing a checkpoint.
        seeds: the seeds.

    Raises:
        ContractError: the method raises, writes to the demonstrations, or returns something that
            cannot be stored.
    """
    found = fitted(method, values, layout, demos, validation, seeds)
    return [stored(one, values, layout) for one in found]


def fitted(
    method: type[Method],
    values: Mapping[str, Any],
    layout: Layout,
    demos: Sequence[Demos],
    validation: Sequence[Demos],
    seeds: Sequence[int],
) -> list[Method]:
    """Returns the objects from the method's `fit_seeds`, see `learn`."""
    given = list(map(_copied, demos)), list(map(_copied, validation))
    config = build(method, values, layout).config
    with _calling("fit"):
        found = method.fit_seeds(config, layout, *given, list(seeds))
        kinds = [type(one).__name__ for one in found]
    if [*map(_digest, chain(*given))] != [*map(_digest, chain(demos, validation))]:
        raise ContractError("fit wrote to the demonstrations that it was given")
    of_its_kind = all(isinstance(one, method) for one in found)
    if not of_its_kind or not len({*map(id, found)}) == len(found) == len(seeds):
        raise ContractError(
            f"fit_seeds must return {len(seeds)} of {method.__name__}, an object for each seed, got"
            f" {kinds}"
        )
    return list(found)


def _copied(demos: Demos) -> Demos:
    return demos[np.arange(len(demos))]


def _digest(demos: Demos) -> str:
    digest = hashlib.sha256()
    for array in (demos.states, demos.velocities, demos.actions, demos.starts.values):
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def stored(fit: Method, values: Mapping[str, Any], layout: Layout) -> Learnt:
    """Stores what a fitted method has learnt, see `learn`."""
    with _calling("parameters"):
        parameters = checked_bytes(fit.parameters(), "parameters")
    if not from_bytes(parameters):
        raise ContractError("parameters() is empty: load would have nothing to restore")
    with _calling("diagnostics"):
        diagnostics = checked_bytes(fit.diagnostics(), "diagnostics")
    return Learnt(parameters, diagnostics, loaded(type(fit), values, layout, parameters))


def loaded(
    method: type[Method], values: Mapping[str, Any], layout: Layout, parameters: bytes
) -> Method:
    """Returns a new object of a method that has loaded parameters from `learn`.

    Raises:
        ContractError: the method raises.
    """
    again = build(method, values, layout)
    with _calling("load"):
        again.load(from_bytes(parameters))
    return again


def checked_bytes(arrays: Any, what: str) -> bytes:
    """Returns a method's arrays by name as bytes, which `tasks.files.from_bytes` reads.

    Args:
        arrays: whatever the method returned.
        what: the name of its function, for the error message.

    Raises:
        ContractError: it is not a dictionary of arrays that can be stored.
    """
    if not isinstance(arrays, Mapping):
        raise ContractError(f"{what}() must return arrays by name, got {_shown(arrays)}")
    for name, array in arrays.items():
        if not isinstance(name, str) or not name.isprintable() or name in ("", "__metadata__"):
            raise ContractError(f"{what}() names an array {name!r}: names must be printable texts")
        plain = type(array) is np.ndarray and array.dtype.kind in "biufc"
        if not plain or array.dtype.itemsize > (16 if array.dtype.kind == "c" else 8):
            raise ContractError(
                f"{what}() holds {name!r}, {_shown(array)}: allowed are NumPy arrays of truth"
                " values, integers, floats up to 64 bits and complex numbers up to 128 bits"
            )
    size = sum(array.nbytes for array in arrays.values())
    if size > MAX_BYTES:
        raise ContractError(
            f"{what}() takes {size / 2**30:.1f} GiB, allowed is {MAX_BYTES / 2**30:g}"
        )
    native = {name: array.astype(array.dtype.newbyteorder("=")) for name, array in arrays.items()}
    return to_bytes(native)


def motion(method: MotionMethod, start: FloatArray, steps: int) -> FloatArray:
    """Returns the motion that a method predicts, (B, steps + 1, D) or (B, steps + 1, H).

    The motion may hold NaN and infinite numbers.

    Args:
        method: a fitted method.
        start: x(1), (B, D).
        steps: number of states after the start.

    Raises:
        ContractError: the method raises, or its answer is not a NumPy array of floats with one of
            these shapes.
    """
    layout = method.layout
    shapes = [(len(start), steps + 1, dim) for dim in (layout.state_dim, layout.robot_dim)]
    with _calling("rollout"):
        return _floats(method.rollout(start.copy(), steps), "rollout", shapes)


def begin(method: ActionMethod, starts: FloatArray, rngs: Sequence[np.random.Generator]) -> None:
    """Resets a method for episodes.

    Args:
        method: a fitted method.
        starts: the states at which episodes begin, (B, D).
        rngs: for each episode, the generator of its random numbers.

    Raises:
        ContractError: the method raises.
    """
    with _calling("reset"):
        method.reset(starts.copy(), list(rngs))


def actions(method: ActionMethod, state: FloatArray, t: int) -> FloatArray:
    """Returns the actions (B, A) of a method for the states (B, D) after t control steps.

    The actions may hold NaN and infinite numbers.

    Raises:
        ContractError: the method raises, or its answer is not a NumPy array of floats with this
            shape.
    """
    shapes, when = [(len(state), method.layout.action_dim)], f", at t={t}"
    with _calling("act", when):
        return _floats(method.act(state.copy(), t), "act", shapes, when)


def _floats(answer: Any, of: str, shapes: Sequence[tuple[int, ...]], when: str = "") -> FloatArray:
    if type(answer) is not np.ndarray or answer.dtype.kind != "f":
        raise ContractError(f"{of} must return a NumPy array of floats, got {_shown(answer)}{when}")
    if answer.shape not in shapes:
        expected = " or ".join(map(str, dict.fromkeys(shapes)))
        raise ContractError(f"{of} returned shape {answer.shape}, expected {expected}{when}")
    return np.array(answer, np.float64, order="C")


def _shown(value: Any) -> str:
    kind = f"{type(value).__module__}.{type(value).__qualname__}".removeprefix("builtins.")
    return f"{kind} of {value.dtype}" if isinstance(value, np.ndarray) else kind
