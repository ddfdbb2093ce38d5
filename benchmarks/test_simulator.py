"""Environment steps a second: the simulator and whole rollouts, against their peers."""

import os
from functools import partial
from itertools import cycle, pairwise

import mujoco
import numpy as np
import pytest
import torch
from mujoco.batch import Batch
from torch import nn

from bench.controller import Controller, ControllerConfig, train_controller
from bench.probe import Recorded
from bench.rollout import TrackedMotion
from tasks.base import Task
from tasks.data import Demos, FloatArray, generator
from tasks.experts import load_expert
from tasks.registry import TASKS, get_task
from tasks.simulator import CHUNK, SUBSTEPS, Policy, Simulator, rollout

STEPS = 30
"""Control steps from the starts, placing the episodes included."""
DECIDED = 100
"""Episodes whose steps are counted until they are decided."""
VECTOR_STEPS = 500
ENVIRONMENTS = {
    "tool": "AdroitHandHammer-v1",
    "door": "AdroitHandDoor-v1",
    "relocation": "AdroitHandRelocate-v1",
    "reorientation": "AdroitHandPen-v1",
}
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(params=TASKS)
def task(request):
    return get_task(request.param)


def random_actions(task: Task, n: int, steps: int) -> FloatArray:
    rng = generator("benchmark actions", task.name)
    return rng.uniform(-1, 1, (steps, n, task.layout.action_dim))


def stepping(task: Task, actions: FloatArray):
    """Takes the actions in the simulator, with state and observation after each."""
    starts = task.sample("test", CHUNK)

    def run() -> None:
        simulator = Simulator(task, starts)
        for action in actions:
            simulator.step(action)
            simulator.state()
            simulator.observe()

    return run


def bare_stepping(task: Task, actions: FloatArray):
    """Does the same physics on the model as loaded, all sensors included, and reads nothing."""
    model = mujoco.MjModel.from_xml_path(str(task.model_path))
    model.actuator_gainprm[:] = task.model.actuator_gainprm
    model.actuator_biasprm[:] = task.model.actuator_biasprm
    starts = task.sample("test", CHUNK).values
    low, high = model.actuator_ctrlrange.T
    controls = (low + high) / 2 + np.clip(actions, -1, 1) * (high - low) / 2

    def run() -> None:
        batch = Batch(model, CHUNK)
        task.place(batch, starts)
        for control in controls:
            batch.ctrl[:] = control
            batch.step(nstep=SUBSTEPS)

    return run


def vector_stepping(task: Task, kind: str):
    """Does STEPS steps of gymnasium's vectorised environments, one a core."""
    import gymnasium

    workers = os.cpu_count() or 1
    make = partial(gymnasium.make, f"gymnasium_robotics:{ENVIRONMENTS[task.name]}")
    if kind == "sync":
        envs = gymnasium.vector.SyncVectorEnv([make] * workers)
    else:
        envs = gymnasium.vector.AsyncVectorEnv([make] * workers, context="spawn")
    envs.reset(seed=0)
    actions = cycle(random_actions(task, workers, VECTOR_STEPS).astype(np.float32))

    def run() -> None:
        for _ in range(VECTOR_STEPS):
            envs.step(next(actions))

    return run, envs, VECTOR_STEPS * workers


def test_against_bare_batch_step(task, compare):
    actions = random_actions(task, CHUNK, STEPS)
    ours, bare = stepping(task, actions), bare_stepping(task, actions)
    compare(f"simulator_vs_bare[{task.name}]", ours, bare, 0.90, (STEPS * CHUNK,) * 2)


@pytest.mark.parametrize("kind", ["sync", "async"])
def test_against_gymnasium_vector_environments(task, kind, compare):
    ours = stepping(task, random_actions(task, CHUNK, STEPS))
    run, envs, steps = vector_stepping(task, kind)
    compare(f"simulator_vs_{kind}[{task.name}]", ours, run, 1.0, (STEPS * CHUNK, steps))
    envs.close()


# Rollouts
class InOrder(Recorded):
    """Answers the starts, which are the recorded ones, without a search among them."""

    def rollout(self, start: FloatArray, steps: int) -> FloatArray:
        return self._states[:, : steps + 1]


@pytest.fixture
def tracked(task):
    """Motions around the start, and a controller of the protocol's size; neither need be good."""
    starts = task.sample("test", CHUNK)
    first = Simulator(task, starts).state()
    rng = generator("benchmark rollout", task.name)
    steps = rng.standard_normal((CHUNK, task.horizon, task.layout.state_dim))
    states = first[:, None] + 0.01 * np.cumsum(steps, axis=1)
    states[:, 0] = first
    actions = rng.uniform(-1, 1, (CHUNK, task.horizon - 1, task.layout.action_dim))
    motions = Demos(starts, states, states[:, :, : task.robot_dim], actions)
    weights = train_controller(ControllerConfig(epochs=1), motions[:16], task.name, 1)
    return TrackedMotion(InOrder(motions), Controller(weights))


def authors_loop(task: Task):
    """One episode after another in one environment, the controller asked for one action a step."""
    import gymnasium

    environment = gymnasium.make(f"gymnasium_robotics:{ENVIRONMENTS[task.name]}")
    hand, actions = task.robot_dim, task.layout.action_dim
    widths = (2 * hand, 4 * hand, 4 * hand, 2 * hand, actions)
    layers: list[nn.Module] = []
    for a, b in pairwise(widths):
        layers += [nn.Linear(a, b), nn.ReLU()]
    controller = nn.Sequential(*layers[:-1])

    def run() -> None:
        environment.reset(seed=0)
        for _ in range(VECTOR_STEPS):
            present = environment.unwrapped.data.qpos[:hand]
            seen = torch.from_numpy(np.concatenate([present, present])).float()
            with torch.no_grad():
                action = controller(seen[None])[0].numpy()
            environment.step(np.clip(action, -1, 1))

    return run


def driven(task: Task, policy: Policy):
    starts = task.sample("test", CHUNK)
    return lambda: rollout(task, starts, policy, steps=STEPS, whole=True)


class Overheard:
    """A policy whose actions are kept."""

    def __init__(self, policy: Policy) -> None:
        self.reset, self._policy = policy.reset, policy
        self.actions: list[FloatArray] = []

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        self.actions.append(self._policy.act(simulator, step))
        return self.actions[-1]


def test_a_rollout_against_bare_batch_step(task, tracked, compare):
    """Both take the same actions from the same starts, and so meet the same contacts."""
    policy = Overheard(tracked)
    driven(task, policy)()
    ours, bare = driven(task, tracked), bare_stepping(task, np.array(policy.actions))
    compare(f"rollout_vs_bare[{task.name}]", ours, bare, 1.0, (STEPS * CHUNK,) * 2)


def test_a_rollout_against_the_authors_loop(task, tracked, compare):
    work = (STEPS * CHUNK, VECTOR_STEPS)
    ours = driven(task, tracked)
    compare(f"rollout_vs_authors_loop[{task.name}]", ours, authors_loop(task), 1.0, work)


@pytest.mark.parametrize(("name", "target"), [("relocation", 1.5), ("reorientation", 2.0)])
def test_decided_episodes(name, target, compare):
    """The expert's episodes, ended once they are decided and simulated whole."""
    task = get_task(name)
    expert, starts = load_expert(task).policy, task.sample("probe", DECIDED)
    compare(
        f"decided_{name}",
        ours=lambda: rollout(task, starts, expert),
        peer=lambda: rollout(task, starts, expert, whole=True),
        target=target,
        work=(DECIDED, DECIDED),
    )
