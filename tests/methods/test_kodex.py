from itertools import pairwise

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from methods.base import NotFittedError, config_of
from methods.kodex import RAW, Kodex, KodexConfig, solve_koopman, solve_normal_equations
from methods.lifting import get_observables, lift
from tasks.data import Demos, Layout, Starts, generator
from tasks.demos import load_demos, split
from tasks.errors import InputError
from tasks.registry import TASKS, get_task

LAYOUT = Layout(robot_dim=3, object_dim=2, action_dim=3)


def make_demos(states) -> Demos:
    n, t, _ = states.shape
    starts = Starts("toy", "demo", np.arange(n), np.zeros((n, 1)))
    return Demos(starts, states, np.zeros((n, t, 3)), np.zeros((n, t - 1, 3)))


@pytest.fixture
def noisy():
    """Motions that span the lifted space."""
    return make_demos(generator("kodex").standard_normal((30, 20, 5)))


@pytest.fixture
def flat():
    """Motions on a plane in state space, for which half the directions of G are exactly zero."""
    rng = generator("kodex flat")
    turn = np.linalg.qr(rng.standard_normal((2, 2)))[0] * 0.98
    plane = np.zeros((30, 20, 2))
    plane[:, 0] = rng.uniform(0.5, 1, (30, 2))
    for t in range(1, 20):
        plane[:, t] = plane[:, t - 1] @ turn.T
    spread = np.array([[1.0, 0, 0, 1, 0], [0, 1, 0, 0, 1]])
    return make_demos(plane @ spread)


def hidden(size) -> Demos:
    """Motions whose last component follows one of this size, which hardly shows beside the rest."""
    rng = generator("hidden")
    states = rng.uniform(-1, 1, (30, 20, 5)) * [1, 1, 1, size, 1]
    states[:, 1:, 4] = states[:, :-1, 3] / size
    return make_demos(states)


def nothing(robot, _):
    """Returns no observables beyond the state, (..., 0)."""
    return robot[..., :0]


def fitted(demos, **config) -> Kodex:
    """Returns KODex with raw states, unless the config says otherwise."""
    kodex = Kodex(KodexConfig(**RAW | config), LAYOUT)
    kodex.fit(demos, demos, 1)
    return kodex


def by_definition(demos, observables):
    """Returns K by appendix (9), pair by pair, in plain loops."""
    a, g, pairs = 0, 0, 0
    for motion in demos.states:
        for x, after in pairwise(motion):
            phi, phi_after = lift(x, 3, observables), lift(after, 3, observables)
            a = a + np.outer(phi_after, phi)
            g = g + np.outer(phi, phi)
            pairs += 1
    cutoff = len(g) * np.finfo(float).eps
    return (a / pairs) @ np.linalg.pinv(g / pairs, rcond=cutoff)


def step_by_step(koopman, observables, start, steps):
    """Returns motions by appendix (3) and (8): lifted states are multiplied by K and read out."""
    z, motion = lift(start, 3, observables), [start]
    for _ in range(steps):
        z = np.array([koopman @ one for one in z])
        motion.append(z[:, :5])
    return np.stack(motion, axis=1)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
@pytest.mark.parametrize("kind", ["noisy", "flat"])
def test_motions_match_the_definition(request, kind, number):
    demos = request.getfixturevalue(kind)
    observables = get_observables(number)
    koopman = by_definition(demos, observables)
    start = demos.states[:7, 0]
    expected = step_by_step(koopman, observables, start, 10)
    motion = fitted(demos, observables=number).rollout(start, 10)
    assert motion.shape == (7, 11, 5)
    assert np.abs(motion - expected).max() <= 1e-8 * np.abs(expected).max()


def test_a_linear_system_is_identified_exactly():
    rng = generator("linear system")
    dynamics = 0.9 * np.linalg.qr(rng.standard_normal((5, 5)))[0]
    states = np.zeros((40, 12, 5))
    states[:, 0] = rng.standard_normal((40, 5))
    for t in range(1, 12):
        states[:, t] = states[:, t - 1] @ dynamics.T
    # Products of a linear system's states evolve linearly too.
    kodex = fitted(make_demos(states), observables=2)
    np.testing.assert_allclose(kodex.rollout(states[:, 0], 11), states, atol=1e-8)
    found = kodex.diagnostics()
    values = found["eigenvalues"] @ [1, 1j]
    for expected in np.linalg.eigvals(dynamics):
        assert np.abs(values - expected).min() < 1e-7
    assert found["one_step_residuals"].max() < 1e-10


def test_seed_validation_and_threads_have_no_effect(noisy):
    koopman = fitted(noisy).koopman
    other = Kodex(KodexConfig(**RAW), LAYOUT)
    with threadpool_limits(2):
        other.fit(noisy, noisy[:1], 7)
    np.testing.assert_array_equal(other.koopman, koopman)


def test_a_stored_operator_gives_the_same_motions(noisy):
    kodex = fitted(noisy)
    start = noisy.states[:4, 0]
    again = Kodex(KodexConfig(**RAW), LAYOUT)
    again.load(kodex.parameters())
    np.testing.assert_array_equal(again.rollout(start, 6), kodex.rollout(start, 6))
    np.testing.assert_array_equal(again.rollout(start, 3), kodex.rollout(start, 6)[:, :4])


@pytest.mark.parametrize("ask", ["parameters", "diagnostics", "rollout"])
def test_a_call_before_fit_raises_not_fitted_error(ask):
    arguments = (np.zeros((1, 5)), 3) if ask == "rollout" else ()
    with pytest.raises(NotFittedError, match="call fit or load"):
        getattr(Kodex(KodexConfig(), LAYOUT), ask)(*arguments)


def test_the_operator_is_a_pinv_g_where_the_lifted_states_are_well_conditioned():
    rng = generator("well conditioned")
    before, after = rng.standard_normal((2, 500, 40))
    expected = (after.T @ before) @ np.linalg.pinv(before.T @ before)
    for solve in (solve_koopman, solve_normal_equations):
        assert np.abs(solve(before, after).koopman - expected).max() <= 1e-9


def test_the_operator_ignores_directions_beyond_a_gap_in_the_singular_values():
    rng = generator("rank deficient")
    basis = np.linalg.qr(rng.standard_normal((40, 40)))[0][:, :30]
    before = rng.standard_normal((500, 30)) * np.logspace(0, -8, 30) @ basis.T
    truth = rng.standard_normal((40, 40)) @ basis @ basis.T
    found = solve_koopman(before, before @ truth.T)
    assert np.abs(found.koopman - truth).max() <= 1e-6
    relative = found.singular_values / found.singular_values[0]
    assert relative[29] > 1e-9 > 1e-14 > relative[30]


def test_normal_equations_lose_directions_that_the_lifted_states_still_show():
    rng = generator("squared condition")
    before = rng.standard_normal((500, 4)) * [1, 1, 1, 1e-9]
    after = before[:, ::-1]
    assert solve_koopman(before, after).koopman[0, 3] == pytest.approx(1, rel=1e-6)
    assert abs(solve_normal_equations(before, after).koopman[0, 3]) < 0.1


def test_directions_below_the_cutoff_are_ignored():
    rng = generator("cutoff")
    before = rng.standard_normal((200, 4)) * [1, 1, 1, 1e-12]
    after = before[:, ::-1]
    assert np.abs(solve_koopman(before, after, cutoff=1e5).koopman[:, 3]).max() < 1e-6
    assert solve_koopman(before, after).koopman[0, 3] == pytest.approx(1, rel=1e-2)


def test_motions_do_not_hang_on_the_order_of_demonstrations_however_small_a_component():
    demos, start = hidden(1e-7), hidden(1e-7).states[:5, 0]

    def motions(**config):
        orders = [generator("order", i).permutation(30) for i in range(5)]
        return [
            fitted(demos[order], observables=nothing, **config).rollout(start, 5)
            for order in orders
        ]

    assert np.ptp(motions(), axis=0).max() <= 1e-6
    assert np.ptp(motions(normal_equations=True), axis=0).max() > 1e-3


ORDERS = [
    pytest.param("door", 2),
    *(pytest.param(task, 5, marks=pytest.mark.long) for task in TASKS),
]


@pytest.mark.parametrize(("task", "orders"), ORDERS)
@pytest.mark.parametrize("variant", ["described", "uncut", "raw"])
def test_motions_of_every_task_do_not_hang_on_the_order_of_demonstrations(task, orders, variant):
    training, validation = split(load_demos(get_task(task)))
    start, steps = validation.states[:, 0], get_task(task).horizon - 1
    motions = []
    for i in range(orders):
        kodex = Kodex(config_of(Kodex, "single", variant), get_task(task).layout)
        order = generator("order", i).permutation(len(training))
        kodex.fit(training[order], validation, 1)
        motions.append(kodex.rollout(start, steps))
    assert np.ptp(motions, axis=0).max() <= 1e-6


def test_states_are_standardised_before_they_are_lifted(noisy):
    states = noisy.states * [1, 10, 100, 1e-3, 1] + [0, 5, -50, 0, 3]
    mean, scale = states.mean(axis=(0, 1)), np.maximum(states.std(axis=(0, 1)), 1e-2)
    standard = make_demos((states - mean) / scale)
    expected = fitted(standard).rollout(standard.states[:6, 0], 8) * scale + mean
    motion = fitted(make_demos(states), standardise=True).rollout(states[:6, 0], 8)
    np.testing.assert_allclose(motion, expected, rtol=1e-7, atol=1e-7)


def test_a_constant_lets_the_state_move_by_an_offset():
    rng = generator("offset")
    states = rng.standard_normal((20, 1, 5)) + np.arange(8)[:, None] * [1.0, -2, 0.5, 0, 3]
    demos = make_demos(states)

    def error(**config):
        model = fitted(demos, observables=nothing, **config)
        return np.abs(model.rollout(states[:, 0], 7) - states).max()

    assert error(constant=True) < 1e-9
    assert error() > 0.1


def test_demonstrations_in_single_precision_are_used_in_double(noisy):
    single = make_demos(noisy.states.astype(np.float32))
    double = make_demos(noisy.states.astype(np.float32).astype(np.float64))
    np.testing.assert_array_equal(fitted(single).koopman, fitted(double).koopman)


@pytest.mark.parametrize(
    ("before", "after", "answer"),
    [
        (np.ones((4, 2), complex), np.ones((4, 2)), "states before must hold real numbers"),
        (np.ones((4, 2)), np.ones((4, 2), object), "states after must hold real numbers"),
        (np.ones((4, 2)), np.ones((3, 2)), r"got \(4, 2\) and \(3, 2\)"),
        (np.ones(4), np.ones(4), r"got \(4,\) and \(4,\)"),
    ],
)
def test_pairs_of_a_wrong_shape_or_type_are_refused(before, after, answer):
    with pytest.raises(InputError, match=answer):
        solve_koopman(before, after)
