import numpy as np
import pytest
import torch

from methods.dmp import WHITENING_FLOOR, DMPConfig, basis_motions, dmp, whitening
from tasks.data import generator

CONFIGS = [DMPConfig(10, 99, 1 / 99), DMPConfig(30, 69, 0.01), DMPConfig(2, 5, 0.2, alpha=10.0)]


def step_by_step(config: DMPConfig, start, goal, weights):
    """Integrates the equations step by step, in the order of the published layer."""
    count = config.basis_functions
    centres = torch.tensor([np.exp(-i / (count - 1)) for i in range(count)])
    widths = count**1.5 / centres
    s, y, z = 1.0, start, torch.full_like(start, config.start_velocity)
    motion = []
    for _ in range(config.steps):
        s = s - config.a_x * s * config.dt
        psi = torch.exp(-widths * (s - centres) ** 2)
        forcing = (weights * psi).sum(dim=-1) / psi.sum() * s * (goal - start)
        change = config.alpha * (config.beta * (goal - y) - z) + forcing
        y, z = y + z * config.dt, z + change * config.dt
        motion.append(y)
    return torch.stack(motion, dim=-2)


def draw(config):
    rng = generator("dmp", config.basis_functions)
    shapes = {"start": (4, 3), "goal": (4, 3), "weights": (4, 3, config.basis_functions)}
    return [
        torch.tensor(rng.standard_normal(shape), requires_grad=True) for shape in shapes.values()
    ]


@pytest.mark.parametrize("config", CONFIGS)
def test_basis_motions_match_step_by_step_integration(config):
    start, goal, weights = draw(config)
    motion = dmp(config, start, goal, 100 * weights)
    expected = step_by_step(config, start, goal, 100 * weights)
    assert motion.shape == (4, config.steps, 3)
    torch.testing.assert_close(motion, expected, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("config", CONFIGS)
def test_gradients_match_step_by_step_integration(config):
    inputs = draw(config)
    pull = torch.tensor(generator("pull").standard_normal((4, config.steps, 3)))
    ours = torch.autograd.grad((dmp(config, *inputs) * pull).sum(), inputs)
    expected = torch.autograd.grad((step_by_step(config, *inputs) * pull).sum(), inputs)
    for one, other in zip(ours, expected, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-10, atol=1e-10)


def test_without_forcing_a_motion_converges_to_its_goal():
    config = DMPConfig(10, 400, 1 / 99)
    start, goal, weights = draw(config)
    motion = dmp(config, start, goal, torch.zeros_like(weights))
    torch.testing.assert_close(motion[:, -1], goal, rtol=0, atol=1e-3)


@pytest.mark.parametrize("config", CONFIGS)
def test_whitened_weights_change_a_motion_equally(config):
    of_weights = basis_motions(config)[3]
    values = np.linalg.svd(of_weights, compute_uv=False)
    alike = (values > WHITENING_FLOOR * values[0]).sum()
    assert alike >= min(config.basis_functions, 10)
    moved = np.linalg.svd(of_weights @ whitening(config), compute_uv=False)
    np.testing.assert_allclose(moved[:alike], config.steps**0.5, rtol=1e-6)
