"""KODex against loops that take one sample, one state or one time step at a time."""

import numpy as np
import pytest

from methods.kodex import Kodex, KodexConfig
from methods.lifting import get_observables, lift
from tasks.data import Demos, FloatArray, Layout, Starts, generator

# Dimensions of the tool task, whose lifted state is the largest: 763 observables and 1.
LAYOUT = Layout(robot_dim=26, object_dim=15, action_dim=26)
HORIZON = 100
LOOP_DEMOS, LOOP_STARTS = 2, 20


@pytest.fixture
def demos() -> Demos:
    states = generator("benchmark kodex").standard_normal((200, HORIZON, 41))
    starts = Starts("tool", "demo", np.arange(200), np.zeros((200, 1)))
    return Demos(starts, states, states[:, :, :26], np.clip(states[:, 1:, :26], -1, 1))


def loop_over_samples(demos: Demos):
    """Does the sums of appendix (9) pair by pair, for LOOP_DEMOS demonstrations."""
    observables = get_observables(3)

    def run() -> None:
        a, g = np.zeros((2, 763, 763))
        for motion in demos.states[:LOOP_DEMOS]:
            for t in range(HORIZON - 1):
                phi = lift(motion[t], 26, observables)
                phi_after = lift(motion[t + 1], 26, observables)
                a += np.outer(phi_after, phi)
                g += np.outer(phi, phi)

    return run


@pytest.mark.parametrize("name", ["kodex_fit"])
def test_fit(compare, demos, name):
    kodex = Kodex(KodexConfig(), LAYOUT)
    # The loop leaves out the pseudo-inverse.
    compare(
        name,
        ours=lambda: kodex.fit(demos, demos, 0),
        peer=loop_over_samples(demos),
        target=5.0,
        work=(len(demos), LOOP_DEMOS),
    )


@pytest.mark.parametrize("name", ["kodex_fit_without_g"])
def test_fit_without_g(compare, demos, name):
    kodex = Kodex(KodexConfig(), LAYOUT)
    with_g = Kodex(KodexConfig(normal_equations=True), LAYOUT)
    compare(
        name,
        ours=lambda: kodex.fit(demos, demos, 0),
        peer=lambda: with_g.fit(demos, demos, 0),
        target=0.25,
    )


def loop_over_starts(kodex: Kodex, starts: FloatArray):
    """Takes the lifted state of each start through K, one step after another."""

    def run() -> None:
        for start in starts:
            z = np.append(lift(start, 26, get_observables(3)), 1.0)
            for _ in range(HORIZON - 1):
                z = kodex.koopman @ z

    return run


@pytest.mark.parametrize("name", ["kodex_rollout"])
def test_rollout(compare, demos, name):
    kodex = Kodex(KodexConfig(), LAYOUT)
    scale = {"state_mean": np.zeros(41), "state_scale": np.ones(41)}
    koopman = np.linalg.qr(generator(name).standard_normal((764, 764)))[0]
    kodex.load({"koopman": koopman, **scale})
    starts = generator(name, "starts").standard_normal((10_000, 41))
    compare(
        name,
        ours=lambda: kodex.rollout(starts, HORIZON - 1),
        peer=loop_over_starts(kodex, starts[:LOOP_STARTS]),
        target=5.0,
        work=(len(starts), LOOP_STARTS),
    )
