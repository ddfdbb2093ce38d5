"""Training the five seeds of a cell together, against plain torch: one seed, one step at a time."""

from dataclasses import replace
from itertools import chain, pairwise
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn
from torch.nn.functional import softplus

from methods.dmp import DMPConfig, forcing_activations, whitening
from methods.lstm import LSTM
from methods.ndp import NDP
from methods.ngf import NGF, integrate
from methods.ngf_gradient import motion_with_gradient
from methods.ngf_published import PublishedNGF
from methods.nn import NN
from tasks.data import CONTROL_STEP, Demos, Layout, Starts, generator

LAYOUT = Layout(robot_dim=28, object_dim=7, action_dim=28)
HORIZON, DEMOS, PLAIN_DEMOS = 100, 64, 32
EPOCHS = 4
"""Enough that what a training begins with, once, does not count for much: there are hundreds."""
SEEDS = (1, 2, 3, 4, 5)


class Stacked(nn.Module):
    """Linear layers with ReLU (or tanh) between them."""

    def __init__(self, *widths: int, bend: Any = nn.ReLU) -> None:
        super().__init__()
        layers = [part for a, b in pairwise(widths) for part in (nn.Linear(a, b), bend())]
        self.layers = nn.Sequential(*layers[:-1])

    def forward(self, x: Tensor) -> Tensor:
        return self.layers(x)


class PlainNN(nn.Module):
    def __init__(self, config: Any) -> None:
        super().__init__()
        self.mlp = Stacked(LAYOUT.state_dim, *config.hidden, LAYOUT.state_dim)

    def forward(self, x: Tensor, steps: int) -> Tensor:
        states = []
        for _ in range(steps):
            x = x + self.mlp(x)
            states.append(x)
        return torch.stack(states, dim=1)


class PlainLSTM(nn.Module):
    def __init__(self, config: Any) -> None:
        super().__init__()
        self.into = nn.Linear(LAYOUT.state_dim, config.embedding)
        self.cell = nn.LSTMCell(config.embedding, config.hidden)
        self.out = nn.Linear(config.hidden, LAYOUT.state_dim)

    def forward(self, x: Tensor, steps: int) -> Tensor:
        memory, states = None, []
        for _ in range(steps):
            memory = self.cell(self.into(x), memory)
            x = self.out(memory[0])
            states.append(x)
        return torch.stack(states, dim=1)


class PlainNDP(nn.Module):
    def __init__(self, config: Any) -> None:
        super().__init__()
        self.count = config.basis_functions
        outputs = LAYOUT.robot_dim * (1 + self.count)
        self.mlp = Stacked(LAYOUT.state_dim, *config.hidden, outputs)

    def forward(self, x: Tensor, steps: int) -> Tensor:
        config = DMPConfig(self.count, steps, 1 / steps)
        goal, weights = self.mlp(x).split([LAYOUT.robot_dim, LAYOUT.robot_dim * self.count], dim=-1)
        weights = weights.unflatten(-1, (LAYOUT.robot_dim, self.count))
        weights = weights @ torch.from_numpy(whitening(config)).float()
        start = y = x[:, : LAYOUT.robot_dim]
        v = torch.full_like(y, config.start_velocity)
        states = []
        for activation in torch.from_numpy(forcing_activations(config)).float():
            force = (goal - start) * (weights @ activation)
            pull = config.alpha * (config.beta * (goal - y) - v) + force
            y, v = y + v * config.dt, v + pull * config.dt
            states.append(y)
        return torch.stack(states, dim=1)


class PlainNGF(nn.Module):
    def __init__(self, config: Any) -> None:
        super().__init__()
        joints, seen = LAYOUT.robot_dim, LAYOUT.robot_dim + LAYOUT.state_dim
        hidden, bend = config.hidden, nn.Tanh
        self.geometry = Stacked(seen, *hidden, 2 * joints, bend=bend)
        self.metric = Stacked(seen, *hidden, joints, bend=bend)
        self.potential = Stacked(seen, *hidden, joints, bend=bend)
        self.damping = Stacked(seen + joints, *hidden, 1, bend=bend)
        self.stiffness = nn.Parameter(torch.full((joints,), config.stiffness))

    def forward(self, context: Tensor, steps: int) -> Tensor:
        q = context[:, : LAYOUT.robot_dim].requires_grad_()
        v = torch.zeros_like(q)
        states = []
        for _ in range(steps):
            place = torch.cat([q, context], dim=-1)
            bend, weight = self.geometry(place).chunk(2, dim=-1)
            share = torch.sigmoid(weight - self.metric(place))
            force = share * bend * v.square().sum(dim=-1, keepdim=True)
            along = (force * v).sum(dim=-1, keepdim=True)
            geometry = force - v * along / (v.square().sum(dim=-1, keepdim=True) + 1e-12)
            psi = 0.5 * (self.stiffness * q + self.potential(place)).square().sum()
            (slope,) = torch.autograd.grad(psi, q, create_graph=True)
            damping = softplus(self.damping(torch.cat([place, v], dim=-1)))
            v = v + CONTROL_STEP * (geometry - (1 - share) * slope - damping * v)
            q = q + CONTROL_STEP * v
            states.append(q)
        return torch.stack(states, dim=1)


PLAIN = {NN: PlainNN, LSTM: PlainLSTM, NDP: PlainNDP, NGF: PlainNGF}
TARGETS = {NN: 3.0, LSTM: 2.0, NDP: 10.0, NGF: 2.0}


@pytest.fixture
def demos() -> Demos:
    steps = generator("benchmark training").standard_normal((DEMOS, HORIZON, LAYOUT.state_dim))
    states = 0.1 * np.cumsum(steps, axis=1)
    starts = Starts("door", "demo", np.arange(DEMOS), np.zeros((DEMOS, 1)))
    return Demos(starts, states, states[:, :, :28], np.clip(states[:, 1:, :28], -1, 1))


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    with torch.random.fork_rng():
        yield
    torch.set_num_threads(before)


def plain_training(module: type[nn.Module], config: Any, states: Tensor, window: int):
    """Trains each seed for EPOCHS on all stretches of some steps."""
    stretches = states.unfold(1, window + 1, 1).transpose(2, 3).flatten(0, 1)

    def run() -> None:
        for seed in SEEDS:
            torch.manual_seed(seed)
            network = module(config)
            adam = torch.optim.Adam(network.parameters(), config.learning_rate)
            orders = [torch.randperm(len(stretches)) for _ in range(EPOCHS)]
            for rows in chain(*(order.split(config.batch_size) for order in orders)):
                motion = stretches[rows]
                predicted = network(motion[:, 0], window)
                loss = (predicted - motion[:, 1:, : predicted.shape[-1]]).square().mean()
                adam.zero_grad()
                loss.backward()
                adam.step()

    return run


@pytest.mark.parametrize("method", PLAIN, ids=lambda method: method.name)
def test_training(compare, demos, method):
    """Work is counted in predicted states; both see each of theirs EPOCHS times."""
    config = replace(method.sizes[method.default_size["relocation"]], epochs=EPOCHS)
    window, plain_window = getattr(config, "window", HORIZON - 1), HORIZON - 1
    if method is NN:
        plain_window = window
    states = torch.from_numpy(demos.states[:PLAIN_DEMOS]).float()
    plain_config = replace(config, batch_size=min(config.batch_size, PLAIN_DEMOS))
    compare(
        f"{method.name}_training",
        ours=lambda: method.fit_seeds(config, LAYOUT, demos, demos[:1], SEEDS),
        peer=plain_training(PLAIN[method], plain_config, states, plain_window),
        target=TARGETS[method],
        work=(
            EPOCHS * DEMOS * (HORIZON - window) * window,
            EPOCHS * PLAIN_DEMOS * (HORIZON - plain_window) * plain_window,
        ),
    )


def test_a_written_gradient(compare, demos, monkeypatch):
    """NGF, one seed, with the gradient written out and with that of autograd."""
    config = replace(NGF.sizes[NGF.default_size["relocation"]], epochs=1)

    def train(motion: Any) -> None:
        monkeypatch.setattr("methods.ngf.motion_with_gradient", motion)
        NGF.fit_seeds(config, LAYOUT, demos[:16], demos[:1], [1])

    compare(
        "ngf_gradient",
        ours=lambda: train(motion_with_gradient),
        peer=lambda: train(integrate),
        target=1.5,
    )


def test_training_in_pieces_that_fit_a_cache(compare, monkeypatch):
    """NGF as published takes all demonstrations as one batch."""
    config = replace(PublishedNGF.sizes["median"], epochs=1)
    steps = generator("benchmark pieces").standard_normal((200, HORIZON, LAYOUT.state_dim))
    starts = Starts("door", "demo", np.arange(200), np.zeros((200, 1)))
    demos = Demos(starts, steps, steps[:, :, :28], np.clip(steps[:, 1:, :28], -1, 1))

    def train(at_once: int | None) -> None:
        monkeypatch.setattr(PublishedNGF, "at_once", at_once)
        PublishedNGF.fit_seeds(config, LAYOUT, demos, demos[:1], SEEDS)

    in_pieces = PublishedNGF.at_once
    compare(
        "published_ngf_pieces",
        ours=lambda: train(in_pieces),
        peer=lambda: train(None),
        target=1.5,
    )
