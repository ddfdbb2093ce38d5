"""The networks and their training loop match torch's own modules and plain loops."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch
from threadpoolctl import threadpool_limits
from torch import nn
from torch.nn import functional

from bench.machine import random_demos
from methods import training
from methods.base import config_of, shortened
from methods.kodex import Kodex
from methods.layers import linear_weights, mlp, mlp_weights, sigmoid, softplus
from methods.lstm import LSTM
from methods.ndp import NDP
from methods.network import windows
from methods.ngf import NGF, acceleration, energised, integrate, potential_gradient
from methods.ngf_gradient import motion_with_gradient
from methods.ngf_published import PublishedNGF
from methods.nn import NN
from methods.registry import get_method
from methods.toy import toy
from methods.training import Schedule, TrainingError, minimise
from tasks.data import Layout, generator
from tasks.errors import InputError
from tasks.registry import get_task

LAYOUT = Layout(robot_dim=3, object_dim=2, action_dim=3)
toy = partial(toy, layout=LAYOUT, horizon=15)

SCHEDULE = Schedule(epochs=3, batch_size=4, learning_rate=1e-2)


def stacked(arrays, networks=1):
    tensors = {k: torch.tensor(v, dtype=torch.float32) for k, v in arrays.items()}
    return {k: v.expand(networks, *v.shape).contiguous() for k, v in tensors.items()}


def as_module(weights, name, index=0):
    weight, bias = weights[f"{name}.weight"][index], weights[f"{name}.bias"][index]
    layer = nn.Linear(weight.shape[1], weight.shape[0])
    layer.load_state_dict({"weight": weight, "bias": bias})
    return layer


def train(draw, loss, data, schedule=SCHEDULE, seeds=(1, 2), **options):
    return minimise(draw, loss, [data] * len(seeds), schedule, "test", seeds, **options)


def draw_line(rng):
    return mlp_weights(rng, "layer", (3, 5, 2))


def line_loss(weights, x, y):
    return (mlp(weights, "layer", x, 2) - y).square().mean(dim=(1, 2))


@pytest.fixture
def line():
    x = generator("line").standard_normal((10, 3))
    return x, x[:, :2] - x[:, 2:]


# Training
@pytest.mark.parametrize("weight_decay", [0.0, 0.5])
def test_training_matches_torch_for_each_seed(line, weight_decay):
    seeds, schedule = (3, 4, 5), replace(SCHEDULE, weight_decay=weight_decay)
    found = train(draw_line, line_loss, line, schedule, seeds=seeds)
    for seed, trained in zip(seeds, found, strict=True):
        weights = stacked(draw_line(generator("weights", "test", seed)))
        network = nn.Sequential(
            as_module(weights, "layer0"), nn.ReLU(), as_module(weights, "layer1")
        )
        optimiser = torch.optim.AdamW(network.parameters(), 1e-2, weight_decay=weight_decay)
        order = generator("order", "test", seed)
        x, y = (torch.tensor(part, dtype=torch.float32) for part in line)
        for _ in range(3):
            for rows in torch.tensor(order.permutation(10)).split(4):
                optimiser.zero_grad()
                nn.functional.mse_loss(network(x[rows]), y[rows]).backward()
                optimiser.step()
        np.testing.assert_allclose(
            trained.weights["layer1.weight"], network[2].weight.detach(), atol=1e-6
        )


def test_a_batch_in_pieces_trains_like_the_whole_batch(line):
    """Ten samples in pieces of three: the last piece is smaller and has less weight."""
    whole, pieces = (
        train(draw_line, line_loss, line, replace(SCHEDULE, batch_size=10), at_once=at_once)[0]
        for at_once in (None, 3)
    )
    np.testing.assert_allclose(pieces.losses, whole.losses, rtol=1e-5)
    for name, array in whole.weights.items():
        np.testing.assert_allclose(pieces.weights[name], array, atol=1e-6)


def test_a_decaying_learning_rate_falls_linearly_to_zero(line, monkeypatch):
    seen = []
    step = training._Adam.step
    monkeypatch.setattr(
        training._Adam, "step", lambda one, rate: seen.append(rate) or step(one, rate)
    )
    train(draw_line, line_loss, line, replace(SCHEDULE, decay=True))
    np.testing.assert_allclose(seen, SCHEDULE.learning_rate * (1 - np.arange(9) / 9))


@pytest.mark.parametrize(
    ("method", "variant"),
    [
        (Kodex, "described"),
        *((method, variant) for method in (NN, LSTM, NDP) for variant in method.variants),
        (NGF, "described"),
        (PublishedNGF, "published"),
    ],
)
def test_a_seed_with_its_own_demonstrations_gives_the_same_fit_alone_and_beside_others(
    method, variant
):
    """Of 21 motions, a mini-batch that fills no vector remains, and a piece of one motion."""
    config = shortened(config_of(method, next(iter(method.sizes)), variant), 1)

    def seed_1(seeds):
        demos = [toy(seed, 21) for seed in seeds]
        validation = [toy(10 + seed, 1) for seed in seeds]
        fitted = method.fit_seeds(config, LAYOUT, demos, validation, seeds)
        one = fitted[seeds.index(1)]
        return one.parameters() | one.diagnostics()

    alone = seed_1([1])
    for seeds in ([1, 7], [7, 1], [5, 7, 3, 1]):
        for name, array in seed_1(seeds).items():
            np.testing.assert_array_equal(array, alone[name])


@pytest.mark.parametrize(
    ("ours", "library"), [(sigmoid, torch.sigmoid), (softplus, functional.softplus)]
)
def test_activations_round_independently_of_position(ours, library):
    x = torch.linspace(-30, 30, 301)
    torch.testing.assert_close(ours(x), library(x))
    for count in range(1, 40):
        assert torch.equal(ours(x[:count]), ours(x)[:count])


def test_the_weights_of_a_seed_do_not_depend_on_its_position():
    """The biases of three networks, 65 numbers each, leave three after a full vector of 16."""
    rng = generator("noise")
    data = tuple(rng.standard_normal((500, 65)) for _ in range(2))
    schedule = replace(SCHEDULE, epochs=40)
    last, first = (
        train(
            lambda rng: mlp_weights(rng, "layer", (65, 65)),
            lambda weights, x, y: (mlp(weights, "layer", x, 1) - y).square().mean(dim=(1, 2)),
            data,
            schedule,
            seeds,
        )
        for seeds in ((1, 2, 3), (3, 1))
    )
    for name, array in last[2].weights.items():
        np.testing.assert_array_equal(first[0].weights[name], array)


def test_resetting_adam_every_batch_steps_by_the_sign_of_the_gradient(line):
    schedule = replace(SCHEDULE, epochs=1, batch_size=10, fresh_adam="batch")
    (trained, _) = train(draw_line, line_loss, line, schedule)
    before = stacked(draw_line(generator("weights", "test", 1)))
    for weight in before.values():
        weight.requires_grad_()
    x, y = (torch.tensor(part, dtype=torch.float32)[None] for part in line)
    line_loss(before, x, y).sum().backward()
    for name, weight in before.items():
        expected = weight.detach() - 1e-2 * weight.grad.sign()
        np.testing.assert_allclose(trained.weights[name], expected[0], atol=1e-5)


def test_the_weights_of_the_lowest_validation_loss_are_kept(line):
    told = iter([3.0, 1.0, 2.0])

    def validate(weights):
        seen.append(weights["layer0.bias"].detach().clone())
        value = next(told)
        return torch.tensor([value, -value])

    seen: list[torch.Tensor] = []
    first, second = train(draw_line, line_loss, line, validate=validate)
    np.testing.assert_array_equal(first.weights["layer0.bias"], seen[1][0])
    np.testing.assert_array_equal(second.weights["layer0.bias"], seen[0][1])
    np.testing.assert_array_equal(first.validation, [3, 1, 2])


def test_seeds_with_unequal_numbers_of_samples_are_refused(line):
    fewer = [part[:7] for part in line]
    with pytest.raises(TrainingError, match=r"as many samples each, got \[10, 7\]"):
        minimise(draw_line, line_loss, [line, fewer], SCHEDULE, "test", [1, 2])


def test_a_training_without_samples_is_refused(line):
    with pytest.raises(TrainingError, match="test has no samples to learn from"):
        train(draw_line, line_loss, [part[:0] for part in line])


def test_a_diverging_training_keeps_its_best_weights_or_raises_if_it_has_none(line):
    losses = iter([1.0, float("nan"), float("nan")])

    def validate(weights):
        return torch.full((2,), next(losses))

    assert np.isfinite(
        train(draw_line, line_loss, line, validate=validate)[0].weights["layer0.bias"]
    ).all()
    x, y = line
    with pytest.raises(TrainingError, match="seed 1 was never finite"):
        train(draw_line, line_loss, (x * np.nan, y))


def test_a_training_whose_last_step_ruins_the_weights_raises(line):
    schedule = replace(SCHEDULE, epochs=1, batch_size=10, learning_rate=1e39, decay=False)
    with pytest.raises(TrainingError, match="never finite, or its weights"):
        train(draw_line, line_loss, line, schedule)


@pytest.mark.parametrize("name", ["nn", "ngf"])
def test_a_fit_outside_of_a_job_does_not_depend_on_the_threads_of_blas(name):
    method = get_method(name)
    config = replace(method.sizes["large"], epochs=1)
    training, validation = random_demos("door")
    found = []
    for threads in (1, 2):
        fitted = method(config, get_task("door").layout)
        with threadpool_limits(threads, "blas"):
            fitted.fit(training, validation, seed=1)
            found.append(fitted.rollout(validation.states[:, 0], 20))
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize(
    ("field", "value", "answer"),
    [
        ("epochs", 0, "above 0"),
        ("learning_rate", -1.0, "above 0"),
        ("weight_decay", -1.0, "0 or more"),
        ("weight_decay", np.nan, "0 or more"),
        ("fresh_adam", "bach", "'batch'"),
    ],
)
def test_schedules_out_of_range_are_refused(field, value, answer):
    with pytest.raises(InputError, match=answer):
        replace(SCHEDULE, **{field: value})


@pytest.mark.parametrize(
    ("kind", "field", "value", "answer"),
    [
        (NN, "hidden", (0,), "hidden must be above 0, got (0,)"),
        (NN, "window", 0, "window must be above 0, got 0"),
        (NN, "epochs", 0, "epochs must be above 0, got 0"),
        (LSTM, "hidden", 0, "hidden must be above 0, got 0"),
        (LSTM, "embedding", -1, "embedding must be above 0, got -1"),
        (NGF, "hidden", (4, 0), "hidden must be above 0, got (4, 0)"),
        (NGF, "window", 0, "window must be above 0, got 0"),
        (PublishedNGF, "embedding", 6, "embedding must be a multiple of 4, got 6"),
        (NDP, "hidden", (4, -1), "hidden must be above 0, got (4, -1)"),
        (NDP, "basis_functions", 1, "basis_functions must be above 1, got 1"),
        (NDP, "dt", 0.0, "dt must be above 0 and below 1, got 0.0"),
        (NDP, "dt", 1.0, "dt must be above 0 and below 1, got 1.0"),
    ],
)
def test_configs_out_of_range_are_refused(kind, field, value, answer):
    with pytest.raises(InputError, match=re.escape(answer)):
        replace(kind.sizes["small"], **{field: value})


def test_windows_are_all_consecutive_states_of_all_motions():
    states = generator("windows").standard_normal((2, 6, 3))
    expected = [states[b, t : t + 3] for b in range(2) for t in range(4)]
    np.testing.assert_array_equal(windows(states, 2), expected)


# Networks
def weights_of(method):
    return stacked(method.draw(generator("weights of", method.name)))


@pytest.fixture
def start():
    return torch.tensor(toy(2, 4).states[:, 0], dtype=torch.float32)[None]


def test_lstm_matches_torch(start):
    method = LSTM(LSTM.sizes["small"], LAYOUT)
    weights = weights_of(method)
    cell = nn.LSTMCell(100, 200)
    gates = weights["gates.weight"][0]
    state = {"weight_ih": gates[:, :100], "weight_hh": gates[:, 100:]}
    biases = {"bias_ih": weights["gates.bias"][0], "bias_hh": torch.zeros(800)}
    cell.load_state_dict(state | biases)
    into, out = as_module(weights, "into"), as_module(weights, "out")
    x, memory, expected = start[0], None, []
    for _ in range(5):
        memory = cell(into(x), memory)
        x = out(memory[0])
        expected.append(x)
    torch.testing.assert_close(
        method.unroll(weights, start, 5)[0], torch.stack(expected, dim=1), rtol=1e-4, atol=1e-5
    )


@pytest.mark.parametrize("kind", [NN, LSTM])
def test_teacher_forcing_predicts_from_the_truth(kind, start):
    method = kind(kind.sizes["small"], LAYOUT)
    weights = weights_of(method)
    free = method.unroll(weights, start, 5)
    truth = torch.cat([start[:, :, None], free], dim=2)
    torch.testing.assert_close(method.unroll(weights, start, 5, truth), free)
    other = method.unroll(weights, start, 5, truth + torch.arange(6.0)[:, None])
    assert (other - free).abs().max() > 1e-3


@pytest.mark.parametrize("kind", [NN, LSTM, NDP])
def test_published_variants_follow_the_published_training(kind):
    config = replace(kind.sizes["small"], **kind.variants["published"])
    assert not config.standardise
    assert config.epochs == 200
    assert config.fresh_adam == ("epoch" if kind is NDP else "batch")


def test_published_ndp_drives_the_whole_state_with_a_fixed_step(start):
    config = replace(NDP.sizes["small"], **NDP.variants["published"])
    assert NDP(config, LAYOUT).unroll(weights_of(NDP(config, LAYOUT)), start, 14).shape[-1] == 5
    assert NDP(NDP.sizes["small"], LAYOUT).driven == 3


def test_published_ndp_has_the_published_initial_weights():
    config = replace(NDP.sizes["small"], **NDP.variants["published"])
    first, last = (f"layer{i}.weight" for i in (0, 3))
    arrays = NDP(config, LAYOUT).draw(generator("start"))
    assert np.abs(arrays[first]).max() == pytest.approx(32**-0.5, rel=0.05)
    np.testing.assert_allclose(arrays[last].T @ arrays[last], np.eye(32), atol=1e-12)
    assert set(arrays["layer1.bias"]) == {0.1}
    assert not arrays["layer3.bias"].any()


# The fabric
@pytest.fixture
def fabric():
    method = NGF(NGF.sizes["small"], LAYOUT)
    weights = {k: v.double() for k, v in weights_of(method).items()}
    rng = generator("fabric")
    q, v = torch.tensor(rng.standard_normal((2, 1, 4, 3)))
    first = NGF.sizes["small"].hidden[0]
    names = ("geometry", "metric", "potential", "damping")
    context = {name: torch.tensor(rng.standard_normal((1, 4, first))) for name in names}
    return weights, context, q, v


def silent(weights, *names):
    """The same fabric with some parts switched off."""
    quiet = dict(weights)
    for name in names:
        if name == "potential":
            quiet["stiffness"] = torch.zeros_like(weights["stiffness"])
            quiet |= {k: torch.zeros_like(v) for k, v in weights.items() if k.startswith(name)}
        else:
            quiet[f"{name}2.weight"] = torch.zeros_like(weights[f"{name}2.weight"])
            quiet[f"{name}2.bias"] = torch.full_like(weights[f"{name}2.bias"], -1e4)
    return quiet


def test_the_fabric_alone_does_no_work_and_is_quadratic_in_velocity(fabric):
    weights, context, q, v = fabric
    alone = silent(weights, "potential", "damping")
    force = acceleration(alone, context, q, v)
    assert force.abs().max() > 1e-3
    assert (force * v).sum(dim=-1).abs().max() < 1e-12
    torch.testing.assert_close(acceleration(alone, context, q, 3 * v), 9 * force)


@pytest.mark.parametrize("window", [3, 14])
def test_windows_of_the_fabrics_own_motion_have_no_loss(start, window):
    method = NGF(replace(NGF.sizes["small"], window=window), LAYOUT)
    weights = {k: v.double() for k, v in weights_of(method).items()}
    start = start.double()
    joints = torch.cat([start[:, :, None, :3], method.unroll(weights, start, 14)], dim=2)
    states = torch.cat([joints, start[:, :, None, 3:].expand(-1, -1, 15, -1)], dim=-1)[0].numpy()
    contexts, stretches = method.samples(states)
    assert len(contexts) == len(stretches) == len(states) * (15 - window)
    samples = [torch.tensor(part)[None] for part in (contexts, stretches)]
    assert method.loss(weights, *samples) < 1e-20
    samples[1][0, 0, 1] += 0.1
    assert method.loss(weights, *samples) > 1e-6


def test_the_potential_force_is_the_gradient_of_its_potential(fabric):
    weights, context, q, _ = fabric
    q.requires_grad_()
    first = torch.tanh(
        mlp({k.replace("potential0", "a0"): v for k, v in weights.items()}, "a", q, 1)
        + context["potential"]
    )
    second = torch.tanh(
        torch.baddbmm(weights["potential1.bias"][:, None], first, weights["potential1.weight"].mT)
    )
    out = torch.baddbmm(
        weights["potential2.bias"][:, None], second, weights["potential2.weight"].mT
    )
    psi = 0.5 * (weights["stiffness"][:, None] * q + out).square().sum()
    (expected,) = torch.autograd.grad(psi, q)
    torch.testing.assert_close(potential_gradient(weights, context["potential"], q), expected)


def gradients(motion, weights, *arguments):
    """Returns gradients of a sum of squares of a motion, to which every weight contributes."""
    weights = {name: weight.clone().requires_grad_() for name, weight in weights.items()}
    loss = (motion(weights, *arguments) - 1).square().sum()
    return dict(zip(weights, torch.autograd.grad(loss, list(weights.values())), strict=True))


@pytest.mark.parametrize("seeds", [1, 3])
def test_the_written_gradient_of_a_fabric_matches_autograd(seeds):
    method = NGF(NGF.sizes["small"], LAYOUT)
    drawn = [method.draw(generator("gradient", seed)) for seed in range(seeds)]
    weights = {k: torch.tensor(np.stack([arrays[k] for arrays in drawn])) for k in drawn[0]}
    noise = torch.tensor(generator("noise").standard_normal((seeds, 4, 11)))
    arguments = *noise.split([5, 3, 3], dim=-1), 6
    torch.testing.assert_close(
        motion_with_gradient(weights, *arguments), integrate(weights, *arguments)
    )
    torch.testing.assert_close(
        gradients(motion_with_gradient, weights, *arguments),
        gradients(integrate, weights, *arguments),
    )


def test_an_untrained_fabric_is_critically_damped():
    method = NGF(NGF.sizes["small"], LAYOUT)
    arrays = method.draw(generator("critical"))
    pull = np.square(arrays["stiffness"])
    damping = softplus(torch.from_numpy(arrays["damping2.bias"])).numpy()
    np.testing.assert_allclose(damping, 2 * np.sqrt(pull[0]), rtol=0.02)


def test_damping_takes_energy_and_motions_rest_where_the_potential_is_flat(fabric):
    weights, context, q, v = fabric
    damped = acceleration(silent(weights, "potential"), context, q, v)
    assert ((damped * v).sum(dim=-1) < 0).all()
    at_rest = acceleration(weights, context, q, torch.zeros_like(v))
    pull = -potential_gradient(weights, context["potential"], q)
    assert (at_rest * pull > 0).all()


def test_energising_keeps_the_force_across_the_motion():
    v = torch.tensor([[[3.0, 0.0, 0.0]]])
    force = torch.tensor([[[1.0, 2.0, 3.0]]])
    torch.testing.assert_close(energised(force, v), torch.tensor([[[0.0, 2.0, 3.0]]]))


def test_published_ngf_is_causal_and_starts_every_token_alike(start):
    method = PublishedNGF(PublishedNGF.sizes["small"], LAYOUT)
    weights = weights_of(method)
    longer, shorter = (method.unroll(weights, start, steps) for steps in (12, 7))
    assert longer.shape == (1, 4, 12, 3)
    torch.testing.assert_close(longer[:, :, :7], shorter, rtol=1e-4, atol=1e-5)


def test_initial_weights_have_the_bounds_of_torch():
    arrays = linear_weights(generator("bounds"), "layer", 25, 400)
    assert arrays["layer.weight"].shape == (400, 25)
    for array in arrays.values():
        assert 0.19 < np.abs(array).max() <= 0.2


@pytest.mark.parametrize("method", [NN, LSTM, NDP, NGF, PublishedNGF])
def test_each_size_of_a_network_has_more_weights_than_the_previous_one(method):
    """Tables 2 to 5."""
    rng = generator("sizes")
    drawn = [method(config, LAYOUT).draw(rng) for config in method.sizes.values()]
    counts = [sum(array.size for array in arrays.values()) for arrays in drawn]
    assert counts == sorted(set(counts))


def test_nn_predicts_the_rest_of_its_own_motion_from_any_state_of_it():
    demos = toy(0, 12)
    method = NN(replace(NN.sizes["small"], epochs=3), LAYOUT)
    method.fit(demos, demos, 1)
    whole = method.rollout(toy(2, 4).states[:, 0], 40)
    for t in (1, 17, 39):
        rest = method.rollout(whole[:, t], 40 - t)
        np.testing.assert_allclose(rest, whole[:, t:], atol=1e-5)
