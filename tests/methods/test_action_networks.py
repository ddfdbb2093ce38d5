from dataclasses import replace

import numpy as np
import pytest
import torch

from methods.bc import BC, BCConfig
from methods.chunk import Chunk, ChunkConfig
from methods.flow import Flow, FlowConfig
from methods.layers import tensor
from tasks.data import Demos, Layout, Starts, generator
from tasks.errors import InputError

LAYOUT = Layout(robot_dim=2, object_dim=1, action_dim=2)
SHORT = {"hidden": (16, 16), "epochs": 4, "batch_size": 32}


def make_demos(states, actions, stream="demo") -> Demos:
    n = len(states)
    starts = Starts("toy", stream, np.arange(n), np.zeros((n, 1)))
    return Demos(starts, states, np.zeros((n, states.shape[1], 2)), actions)


def linear(count, steps=12, noise=0.1, seed=0):
    """Demonstrations of u = A x + noise, from states that are all over the place."""
    rng = generator("linear", seed)
    states = rng.uniform(-1, 1, (count, steps, 3))
    gain = np.array([[0.3, -0.2, 0.1], [0.1, 0.3, -0.3]])
    actions = states[:, :-1] @ gain.T + noise * rng.standard_normal((count, steps - 1, 2))
    return make_demos(states, np.clip(actions, -1, 1)), gain


def streams(count):
    return [generator("episode", i) for i in range(count)]


def fitted(kind, config, demos=None):
    demos = linear(20)[0] if demos is None else demos
    method = kind(config, LAYOUT)
    method.fit(demos, demos, 1)
    return method


def test_bc_learns_a_linear_policy():
    demos, gain = linear(150)
    config = BCConfig(hidden=(32,), epochs=60, batch_size=64, learning_rate=3e-3)
    bc, x = fitted(BC, config, demos), generator("asked").uniform(-0.8, 0.8, (50, 3))
    bc.reset(x, streams(50))
    assert np.abs(bc.act(x, 0) - x @ gain.T).max() < 0.06


def test_a_chunk_of_one_action_is_bc():
    bc = fitted(BC, BCConfig(**SHORT))
    chunk = Chunk(ChunkConfig(**SHORT, length=1, horizon=1), LAYOUT)
    chunk.load(bc.parameters())
    x = generator("asked").uniform(-1, 1, (5, 4, 3))
    for method in (bc, chunk):
        method.reset(x[:, 0], streams(5))
    for t in range(4):
        np.testing.assert_array_equal(chunk.act(x[:, t], t), bc.act(x[:, t], t))
    demos = linear(20)[0]
    weights = {k: tensor(v)[None] for k, v in bc.parameters().items() if k.startswith("layer")}
    sample = tensor(demos.states[:, 0])[None], tensor(demos.actions[:, 0])[None]
    assert chunk.loss(weights, *sample) == bc.loss(weights, *sample)


def test_a_chunk_is_the_next_actions_of_its_demonstration():
    demos, seen = linear(3, steps=7)[0], []

    class Spy(Chunk):
        def loss(self, weights, x, u, *noise):
            seen.append((x, u))
            return super().loss(weights, x, u)

    config = ChunkConfig(**SHORT | {"epochs": 1, "batch_size": 100}, length=4, horizon=2)
    method = fitted(Spy, config, demos)
    x, u = (array[0].numpy() for array in seen[-1])  # validation, in order
    arrays = method.parameters()
    states = x * arrays["state_scale"] + arrays["state_mean"]
    chunks = u.reshape(3, 6, 4, 2) * arrays["action_scale"] + arrays["action_mean"]
    np.testing.assert_allclose(states.reshape(3, 6, 3), demos.states[:, :-1], atol=1e-6)
    for t in range(6):
        for j in range(4):
            expected = demos.actions[:, min(t + j, 5)]  # the last action is repeated
            np.testing.assert_allclose(chunks[:, t, j], expected, atol=1e-6)


def test_the_state_is_looked_at_every_horizon_steps():
    chunk = fitted(Chunk, ChunkConfig(**SHORT, length=5, horizon=3))
    states = generator("asked").uniform(-1, 1, (4, 9, 3))
    chunk.reset(states[:, 0], streams(4))
    acted = np.stack([chunk.act(states[:, t], t) for t in range(9)], axis=1)
    other = states.copy()
    other[:, [1, 2, 4, 5, 7, 8]] = 0.0
    chunk.reset(other[:, 0], streams(4))
    np.testing.assert_array_equal(
        np.stack([chunk.act(other[:, t], t) for t in range(9)], axis=1), acted
    )
    other[:, 3] = 0.0
    chunk.reset(other[:, 0], streams(4))
    again = np.stack([chunk.act(other[:, t], t) for t in range(9)], axis=1)
    assert np.abs(again - acted)[:, 3:6].max() > 0
    np.testing.assert_array_equal(again[:, 6:], acted[:, 6:])


def test_more_actions_than_a_chunk_has_are_refused():
    with pytest.raises(InputError, match="horizon must be at most length, 4, got 5"):
        ChunkConfig(hidden=(4,), length=4, horizon=5)


def exact(x, a, s, mean, sd):
    """The best f for chunks of N(mean(x), sd^2): the conditional mean of a(1) given a(s)."""
    spread = (1 - s) ** 2 + (s * sd) ** 2
    return mean(x) + s * sd**2 / spread * (a - s * mean(x))


def test_flow_draws_from_the_gaussian_whose_field_it_follows(monkeypatch):
    flow = Flow(FlowConfig(hidden=(4,), length=1, horizon=1, steps=400), LAYOUT)

    def mean(x):
        return torch.stack([2 * x[..., 0], x[..., 1] - x[..., 2]], dim=-1)

    monkeypatch.setattr(flow, "end", lambda w, a, s, x: exact(x, a, s, mean, 0.3))
    x = torch.tensor(generator("asked").standard_normal((4000, 3)), dtype=torch.float32)[None]
    drawn = flow.predict({}, x, streams(4000))
    errors = (drawn - mean(x))[0]
    assert errors.mean(dim=0).abs().max() < 0.02
    assert errors.std(dim=0).numpy() == pytest.approx([0.3, 0.3], rel=0.05)


def test_flow_learns_the_exact_field_of_a_linear_gaussian():
    demos, gain = linear(400, noise=0.15)
    config = FlowConfig(
        hidden=(64, 64),
        length=1,
        horizon=1,
        steps=20,
        epochs=40,
        batch_size=128,
        learning_rate=3e-3,
    )
    flow, x = fitted(Flow, config, demos), generator("asked").uniform(-0.7, 0.7, (2000, 3))
    flow.reset(x, streams(2000))
    errors = flow.act(x, 0) - x @ gain.T
    assert np.abs(errors.mean(axis=0)).max() < 0.02
    assert errors.std(axis=0) == pytest.approx([0.15, 0.15], rel=0.15)

    # The learnt field's loss is the least possible, but for what a network of this size misses.
    arrays = flow.parameters()
    weights = {k: tensor(v)[None] for k, v in arrays.items() if k.startswith("layer")}
    scale, shift = arrays["action_scale"], arrays["action_mean"]
    sample, unit = linear(200, noise=0.15, seed=1)[0], 0.15 / scale
    states = (sample.states[:, :-1].reshape(-1, 3) - arrays["state_mean"]) / arrays["state_scale"]
    actions = (sample.actions.reshape(-1, 2) - shift) / scale
    start, s = flow.noise(generator("noise of a test"), len(states))
    between = (1 - s) * start + s * actions

    def mean(x):
        return ((x * arrays["state_scale"] + arrays["state_mean"]) @ gain.T - shift) / scale

    least = np.square(exact(states, between, s, mean, unit) - actions).mean()
    learnt = flow.loss(weights, *(tensor(one)[None] for one in (states, actions, start, s)))
    assert least <= 1.02 * float(learnt) <= 1.1 * least


def test_flow_draws_the_same_in_an_episode_whatever_else_is_asked():
    flow = fitted(Flow, replace(FlowConfig(**SHORT), length=4, horizon=2))
    x = generator("asked").uniform(-1, 1, (6, 5, 3))

    def act(rows):
        flow.reset(x[rows, 0], [streams(6)[row] for row in rows])
        return np.stack([flow.act(x[rows, t], t) for t in range(5)], axis=1)

    np.testing.assert_allclose(act([4, 2]), act(range(6))[[4, 2]], atol=1e-6)
    flow.reset(x[:, 0], [generator("another", i) for i in range(6)])
    assert np.abs(flow.act(x[:, 0], 0) - act(range(6))[:, 0]).max() > 0.01


def test_seeds_draw_other_noise_and_learn_the_same_alone_and_together():
    demos, _ = linear(20)
    config = FlowConfig(**SHORT, length=2, horizon=1)
    both = Flow.fit_seeds(config, LAYOUT, [demos] * 2, [demos] * 2, [1, 2])
    alone = Flow(config, LAYOUT)
    alone.fit(demos, demos, 2)
    for name, array in alone.parameters().items():
        np.testing.assert_array_equal(array, both[1].parameters()[name])
    losses = [method.diagnostics()["losses"] for method in both]
    assert not np.array_equal(*losses)
