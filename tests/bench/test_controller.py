from dataclasses import replace

import numpy as np
import pytest
import torch

from bench.controller import Controller, ControllerConfig, train_controller, train_controllers
from tasks.data import Demos, Starts, generator

CONFIG = ControllerConfig(epochs=3, batch_size=16)


@pytest.fixture
def demos():
    rng = generator("controller demos")
    starts = Starts("toy", "demo", np.arange(4), np.zeros((4, 1)))
    states = rng.standard_normal((4, 11, 5))
    return Demos(starts, states, np.zeros((4, 11, 3)), np.clip(states[:, 1:, :2], -1, 1))


def test_layers_are_those_of_table_6(demos):
    shapes = {
        name: array.shape for name, array in train_controller(CONFIG, demos, "toy", 1).items()
    }
    # H = 3, A = 2: 2 H, 4 H, 4 H, 2 H, A.
    assert shapes == {
        "layer0.weight": (12, 6),
        "layer1.weight": (12, 12),
        "layer2.weight": (6, 12),
        "layer3.weight": (2, 6),
        "layer0.bias": (12,),
        "layer1.bias": (12,),
        "layer2.bias": (6,),
        "layer3.bias": (2,),
    }


def test_actions_equal_those_of_the_same_network_in_torch(demos):
    weights = train_controller(CONFIG, demos, "toy", 1)
    present, wanted = generator("present").standard_normal((2, 7, 3))
    x = torch.tensor(np.concatenate([present, wanted], axis=1), dtype=torch.float32)
    for i in range(4):
        x = torch.nn.functional.linear(
            x, torch.tensor(weights[f"layer{i}.weight"]), torch.tensor(weights[f"layer{i}.bias"])
        )
        x = torch.relu(x) if i < 3 else x
    np.testing.assert_allclose(Controller(weights).act(present, wanted), x.numpy(), atol=1e-6)


def test_training_is_repeatable_and_does_not_touch_the_global_random_stream(demos):
    first = train_controller(CONFIG, demos, "toy", 1)
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    second = train_controller(CONFIG, demos, "toy", 1)
    assert torch.equal(torch.rand(3), expected)
    other = train_controller(CONFIG, demos, "other", 1)
    for name, array in first.items():
        np.testing.assert_array_equal(second[name], array)
    assert any((other[name] != array).any() for name, array in first.items())


def test_the_weights_of_a_seed_do_not_depend_on_the_others_or_on_how_many_samples_they_have(demos):
    alone = train_controller(CONFIG, demos, "toy", 2)
    other = demos[np.array([3, 1, 0, 2])]
    several = train_controllers(CONFIG, [other, demos[:3], demos], "toy", [5, 1, 2])
    for name, array in alone.items():
        np.testing.assert_array_equal(several[2][name], array)
        assert (several[0][name] != array).any()


def test_training_goes_on_from_the_given_weights_of_each_seed(demos):
    given = train_controllers(CONFIG, [demos, demos], "toy", [1, 2])
    fewer = [demos[:3], demos]
    still = train_controllers(replace(CONFIG, learning_rate=1e-30), fewer, "toy", [1, 2], given)
    moved = train_controllers(CONFIG, fewer, "toy", [1, 2], given)
    drawn = train_controllers(CONFIG, fewer, "toy", [1, 2])
    for seed in range(2):
        for name, array in given[seed].items():
            np.testing.assert_array_equal(still[seed][name], array)
            assert (moved[seed][name] != array).any()
            assert (moved[seed][name] != drawn[seed][name]).any()


def test_the_controller_reproduces_its_training_actions(demos):
    config = ControllerConfig(epochs=400, batch_size=8, learning_rate=3e-3)
    controller = Controller(train_controller(config, demos, "toy", 1))
    q = demos.states[:, :, :3]
    actions = controller.act(q[:, :-1].reshape(-1, 3), q[:, 1:].reshape(-1, 3))
    assert np.abs(actions - demos.actions.reshape(-1, 2)).mean() < 0.05
