"""Which arrays are accepted, and how they are converted."""

import numpy as np
import pytest

from tasks.data import Demos, Starts, UnclippedDemos, real, whole
from tasks.errors import InputError

ACCEPTED = {
    "float16": np.float16,
    "float32": np.float32,
    "long double": np.longdouble,
    "big endian": ">f8",
    "little endian": "<f4",
    "integers": np.int8,
    "unsigned": np.uint64,
    "booleans": np.bool_,
}


@pytest.mark.parametrize("dtype", ACCEPTED.values(), ids=ACCEPTED)
def test_real_numbers_become_contiguous_native_float64(dtype):
    values = np.array([[0, 1, 1], [1, 0, 1]]).astype(dtype).T
    found = real("values", values)
    assert found.dtype == np.float64
    assert found.dtype.isnative
    assert found.flags.c_contiguous
    np.testing.assert_array_equal(found, [[0, 1], [1, 0], [1, 1]])


def test_float64_is_not_copied():
    values = np.ones((2, 3))
    assert real("values", values) is values


REFUSED = {
    "complex": (np.ones(3, complex), "complex128"),
    "object": (np.ones(3, object), "object"),
    "text": (np.array(["1.0", "2"]), "<U3"),
    "bytes": (np.array([b"1"]), r"\|S1"),
    "dates": (np.array(["2020-01-01"], "M8[D]"), "datetime64"),
    "masked": (np.ma.masked_invalid([1.0, np.nan]), "float64"),
    "ragged": ([[1.0], [1.0, 2.0]], "cannot be read as an array"),
    "None": ([None], "object"),
    "too large an integer": ([2**70], "object"),
}


@pytest.mark.parametrize(("values", "kind"), REFUSED.values(), ids=REFUSED)
def test_values_that_are_not_real_are_refused_with_name_and_type(values, kind):
    with pytest.raises(InputError, match=f"my array.*{kind}"):
        real("my array", values)


def test_a_long_double_beyond_float64_becomes_infinite():
    assert real("values", np.array([np.longdouble("1e4000")])).tolist() == [np.inf]


@pytest.mark.parametrize("values", [[0, 3], [0.0, 3.0], np.array([0, 3], ">u2")])
def test_whole_numbers_become_int64(values):
    found = whole("indices", values)
    assert found.dtype == np.int64
    assert found.tolist() == [0, 3]


@pytest.mark.parametrize("bad", [0.5, -1, np.nan, np.inf, 2.0**53, 2**64 - 1, "1", 1j])
def test_values_that_are_not_whole_numbers_from_0_are_refused(bad):
    with pytest.raises(InputError, match="indices"):
        whole("indices", np.array([bad]))


@pytest.mark.parametrize("index", [[0.5, 1], [-1, 0], ["0", "1"]])
def test_starts_with_invalid_indices_are_refused(index):
    with pytest.raises(InputError, match="indices of starts of door/test"):
        Starts("door", "test", np.array(index), np.zeros((2, 3)))


def test_arrays_of_starts_are_converted():
    starts = Starts("door", "test", np.array([0.0, 1.0]), np.ones((2, 3), np.float32))
    assert (starts.index.dtype, starts.values.dtype) == (np.int64, np.float64)


def arrays(dtype=np.float64):
    states, velocities, actions = np.ones((2, 4, 9)), np.ones((2, 4, 5)), np.ones((2, 3, 5))
    return {
        name: array.astype(dtype)
        for name, array in zip(
            ("states", "velocities", "actions"), (states, velocities, actions), strict=True
        )
    }


STARTS = Starts("door", "demo", np.arange(2), np.zeros((2, 3)))


def test_arrays_of_demonstrations_are_converted():
    demos = Demos(STARTS, **arrays(">f4"))
    assert {array.dtype for array in (demos.states, demos.velocities, demos.actions)} == {
        np.dtype(np.float64)
    }


@pytest.mark.parametrize("name", ["states", "velocities", "actions"])
@pytest.mark.parametrize("dtype", [complex, object, str])
def test_demonstrations_that_are_not_real_are_refused(name, dtype):
    given = arrays()
    given[name] = given[name].astype(dtype)
    with pytest.raises(InputError, match=f"{name} of demonstrations must hold real numbers"):
        Demos(STARTS, **given)


@pytest.mark.parametrize("value", [1.5, -50.0, np.nextafter(1, 2)])
def test_an_action_out_of_range_is_refused_with_the_allowed_range(value):
    given = arrays()
    given["actions"][1, 2, 3] = value
    answer = rf"actions of demonstration 1 must lie in \[-1, 1\], got {value:g}"
    with pytest.raises(InputError, match=answer):
        Demos(STARTS, **given)
    demos = UnclippedDemos(STARTS, **given)
    assert demos.actions[1, 2, 3] == value
    assert type(demos[:1]) is UnclippedDemos


@pytest.mark.parametrize("kind", [Demos, UnclippedDemos])
@pytest.mark.parametrize("name", ["states", "velocities", "actions"])
def test_demonstrations_that_are_not_finite_are_refused(kind, name):
    given = arrays()
    given[name][1, 0, 0] = np.inf
    with pytest.raises(InputError, match=f"{name} of demonstration 1 must be finite, got inf"):
        kind(STARTS, **given)
