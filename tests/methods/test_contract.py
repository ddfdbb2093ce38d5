"""What a method returns is stored bit for bit, or refused with a message."""

from dataclasses import dataclass, field

import numpy as np
import pytest
import torch

from methods.contract import (
    MAX_BYTES,
    ContractError,
    actions,
    checked_bytes,
    from_json,
    learn,
    motion,
    resolved,
)
from methods.kodex import Kodex
from methods.toy import LAYOUT, toy
from tasks.files import from_bytes

SOUND = {
    "float64": np.array([0.1, -np.inf, np.nan]),
    "float16": np.arange(3, dtype=np.float16),
    "complex64": np.array([1 + 2j, 3j], np.complex64),
    "complex128": np.array([[1 + 2j], [3j]]),
    "no complex number": np.zeros((0, 2), complex),
    "bool": np.array([True, False]),
    "int8": np.arange(-3, 3, dtype=np.int8),
    "a single number": np.array(3.0),
    "no number": np.zeros((0, 3)),
    "columns first": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "backwards": np.arange(3.0)[::-1],
    "big-endian": np.arange(3.0).astype(">f8"),
    "read-only": np.broadcast_to(1.0, (3, 3)),
}


@pytest.mark.parametrize("name", SOUND)
def test_stored_arrays_are_loaded_as_writable_copies(name):
    (found,) = from_bytes(checked_bytes({name: SOUND[name]}, "parameters")).values()
    assert found.shape == SOUND[name].shape
    assert found.dtype.kind == SOUND[name].dtype.kind
    np.testing.assert_array_equal(found, SOUND[name])
    found[...] = 0


@pytest.mark.parametrize(
    ("arrays", "reason"),
    [
        (None, "must return arrays by name, got NoneType"),
        ([np.ones(1)], "must return arrays by name, got list"),
        ({"x": 1.0}, "holds 'x', float"),
        ({"x": np.array(["a"])}, "numpy.ndarray of <U1"),
        ({"x": np.array([None])}, "numpy.ndarray of object"),
        ({"x": np.ones(1, np.longdouble)}, "numpy.ndarray of float128"),
        ({"x": np.ones(1, np.clongdouble)}, "numpy.ndarray of complex256"),
        ({"x": np.array(0, "M8[s]")}, "numpy.ndarray of datetime64"),
        ({"x": np.ma.masked_array([1.0], [True])}, "numpy.ma.MaskedArray"),
        ({3: np.ones(1)}, "names an array 3"),
        ({"": np.ones(1)}, "names an array ''"),
        ({"\ud800": np.ones(1)}, "names must be printable"),
        ({"__metadata__": np.ones(1)}, "names an array '__metadata__'"),
        ({"x": np.broadcast_to(1.0, MAX_BYTES)}, "takes 8.0 GiB, allowed is 1"),
    ],
)
def test_parameters_that_cannot_be_stored_are_refused(arrays, reason):
    with pytest.raises(ContractError, match=r"^parameters") as refused:
        checked_bytes(arrays, "parameters")
    assert reason in str(refused.value)


@dataclass(frozen=True)
class Config:
    value: object = ()
    derived: int = field(init=False, default=0)

    def __post_init__(self):
        object.__setattr__(self, "derived", len(str(self.value)))


@pytest.mark.parametrize("value", [1, 0.1, "text", None, True, (), ((1, 2), ("a",))])
def test_a_stored_config_equals_the_original(value):
    config = Config(value)
    assert from_json(Config, resolved(config)) == config


@pytest.mark.parametrize("value", [float("nan"), float("inf"), len, [1], {1: 2}, np.ones(2), 1j])
def test_a_config_that_cannot_be_stored_is_refused(value):
    with pytest.raises(ContractError, match=r"cannot be stored|not the same"):
        resolved(Config(value))


class Shared(Kodex):
    @classmethod
    def fit_seeds(cls, config, layout, demos, validation, seeds):
        return super().fit_seeds(config, layout, demos, validation, seeds[:1]) * len(seeds)


def test_fit_seeds_must_return_a_separate_object_for_each_seed():
    values = resolved(Kodex.sizes["single"])
    with pytest.raises(ContractError, match="fit_seeds must return 2 of Shared, an object for"):
        learn(Shared, values, LAYOUT, toy(0, 5), toy(1, 2), [1, 2])


class Torch(Kodex):
    """Learns with torch, which warns about read-only arrays."""

    def fit(self, demos, validation, seed):
        for some in (demos, validation):
            for array in (some.states, some.velocities, some.actions, some.starts.values):
                torch.from_numpy(array)
        super().fit(demos, validation, seed)

    def load(self, parameters):
        torch.from_numpy(parameters["koopman"])
        super().load(parameters)

    def rollout(self, start, steps):
        torch.from_numpy(start)
        return super().rollout(start, steps)


def test_methods_get_writable_arrays_even_from_read_only_demonstrations():
    demos = toy(0, 5)
    for array in (demos.states, demos.velocities, demos.actions, demos.starts.values):
        array.flags.writeable = False
    values = resolved(Torch.sizes["single"])
    (learnt,) = learn(Torch, values, LAYOUT, demos, demos, [1])
    motion(learnt.method, demos.states[:, 0], 3)


class Answers:
    """A method that returns a given answer."""

    layout = LAYOUT

    def __init__(self, answer):
        self.answer = answer

    def rollout(self, start, steps):
        return self.answer

    def act(self, state, t):
        return np.linalg.inv(self.answer)


def test_a_wrong_shape_is_refused_with_the_expected_shapes():
    with pytest.raises(ContractError, match="rollout returned shape") as refused:
        motion(Answers(np.zeros((2, 9, 35))), np.zeros((2, 35)), 9)
    expected = "(2, 9, 35), expected (2, 10, 35) or (2, 10, 28)"
    assert str(refused.value) == f"rollout returned shape {expected}"
    with pytest.raises(ContractError, match=r"expected .*, at t=4$"):
        actions(Answers(np.eye(2)), np.zeros((2, 35)), 4)


def test_an_error_in_a_library_is_reported_at_the_line_of_the_method():
    line = Answers.act.__code__.co_firstlineno + 1
    with pytest.raises(ContractError) as refused:
        actions(Answers(np.zeros((2, 2))), np.zeros((2, 35)), 30)
    place = f"(test_contract.py:{line} in act), at t=30"
    assert str(refused.value) == f"act raised LinAlgError: Singular matrix {place}"
