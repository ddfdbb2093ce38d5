"""A control step of a closed-loop network against the bare network in plain torch."""

import numpy as np
import pytest
import torch
from torch.nn import Linear, ReLU, Sequential

from methods.bc import BC
from methods.scale import Scale
from tasks.data import Layout, generator

LAYOUT = Layout(robot_dim=28, object_dim=11, action_dim=28)
STEPS = 100


@pytest.mark.parametrize("name", ["bc_step"])
def test_one_step(compare, name):
    policy = BC(BC.sizes["median"], LAYOUT)
    unit = Scale(np.zeros(39), np.ones(39)).arrays()
    scales = unit | Scale(np.zeros(28), np.ones(28)).arrays("action")
    policy.load(policy.draw(generator(name)) | scales)
    state = generator(name, "state").standard_normal((1, 39))
    policy.reset(state, [generator(name, "episode")])
    bare = Sequential(Linear(39, 256), ReLU(), Linear(256, 256), ReLU(), Linear(256, 28))

    def in_torch() -> None:
        with torch.no_grad():
            for _ in range(STEPS):
                bare(torch.from_numpy(state).float()).numpy()

    def ours() -> None:
        for t in range(STEPS):
            policy.act(state, t)

    compare(name, ours=ours, peer=in_torch, target=0.25)
