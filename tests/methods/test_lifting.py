import sys

import numpy as np
import pytest

from methods.lifting import SETS, get_observables, lift
from tasks.data import generator
from tasks.errors import InputError

DIMENSIONS = {
    "tool": (26, 15),
    "door": (28, 7),
    "relocation": (30, 12),
    "reorientation": (24, 12),
}
# Table 11 of the appendix: rows are sets 1 to 4.
TABLE_11 = {
    "tool": (82, 512, 763, 1413),
    "door": (70, 469, 546, 1302),
    "relocation": (84, 585, 759, 1629),
    "reorientation": (72, 414, 582, 1134),
}


@pytest.mark.parametrize("task", TABLE_11)
@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_sets_have_the_numbers_of_observables_in_table_11(task, number):
    n, m = DIMENSIONS[task]
    lifted = lift(np.ones((1, n + m)), n, get_observables(number))
    assert lifted.shape == (1, TABLE_11[task][number - 1])


def by_double_loop(number, x_r, x_o):
    """Appendix J, literally: every product once, as a multiset of values."""
    psi = []
    for x, in_robot in ((x_r, True), (x_o, False)):
        n = len(x)
        if number == 1:
            psi += [x[i] ** 2 for i in range(n)]
            continue
        for i in range(n):
            for j in range(n):
                if i <= j:
                    psi.append(x[i] * x[j])
        for i in range(n):
            for j in range(n):
                third = number == 4 or (number == 3 and (i == j or not in_robot))
                if third:
                    psi.append(x[i] ** 2 * x[j])
    return psi


@pytest.mark.parametrize("number", SETS)
def test_observables_match_a_naive_double_loop(number):
    rng = generator("lifting", number)
    state = rng.standard_normal((3, 2, 9))
    lifted = lift(state, 5, get_observables(number))
    np.testing.assert_array_equal(lifted[..., :9], state)
    for one, row in zip(state.reshape(-1, 9), lifted.reshape(6, -1), strict=True):
        expected = by_double_loop(number, one[:5], one[5:])
        np.testing.assert_allclose(np.sort(row[9:]), np.sort(expected), rtol=1e-14)


def sines(x_r, x_o):
    return np.sin(np.concatenate([x_r, x_o], axis=-1))


def test_observables_can_be_a_callable_or_an_import_path():
    state = np.arange(6.0).reshape(2, 3)
    expected = np.concatenate([state, np.sin(state)], axis=1)
    np.testing.assert_array_equal(lift(state, 2, get_observables(sines)), expected)
    assert get_observables("methods.lifting:squares") is get_observables("methods.lifting:squares")


@pytest.mark.parametrize(
    ("chosen", "answer"),
    [
        (5, r"choose from \[1, 2, 3, 4\]"),
        ("nowhere.at_all:f", "cannot import 'nowhere.at_all'"),
        ("", "cannot import ''"),
        ("methods.lifting:square", "did you mean 'squares'"),
    ],
)
def test_unknown_observables_are_refused(chosen, answer):
    with pytest.raises(InputError, match=answer):
        get_observables(chosen)


@pytest.mark.parametrize(
    "text", ["raise SystemExit(3)", "1 / 0", "x = (", "def __getattr__(name): raise OSError(name)"]
)
def test_a_failed_import_of_observables_is_reported_with_its_reason(tmp_path, monkeypatch, text):
    (tmp_path / "broken_observables.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "broken_observables", raising=False)
    with pytest.raises(InputError, match=r"cannot import .*\(broken_observables.py:1"):
        get_observables("broken_observables:psi")


def test_observables_of_a_wrong_shape_are_refused():
    with pytest.raises(InputError, match=r"must have shape \(4,\) \+ \(Q,\), got \(3,\)"):
        lift(np.ones((4, 5)), 2, lambda x_r, x_o: np.ones(3))


@pytest.mark.parametrize("dtype", [complex, object])
def test_states_and_observables_that_are_not_real_are_refused(dtype):
    state = np.ones((4, 5))
    with pytest.raises(InputError, match="states must hold real numbers"):
        lift(state.astype(dtype), 2, get_observables(1))
    with pytest.raises(InputError, match="observables must hold real numbers"):
        lift(state, 2, lambda x_r, x_o: x_r.astype(dtype))


def test_states_in_single_precision_are_lifted_in_double_precision():
    state = np.float32(generator("single").standard_normal((4, 5)))
    lifted = lift(state, 2, get_observables(1))
    assert lifted.dtype == np.float64
    np.testing.assert_array_equal(lifted, lift(state.astype(np.float64), 2, get_observables(1)))
