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
from tasks.simulator import CHUNK, SUBSTEPS, Simulator, rollout

STEPS, DRIVEN = 10, 30
"""Steps of the simulator, and of a rollout, which begins with placing its episodes."""
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
    """Does STEPS control steps of the simulator, with state and observation."""
    simulator = Simulator(task, task.sample("test", CHUNK))
    supply = cycle(actions)

    def run() -> None:
        for _ in range(STEPS):
            simulator.step(next(supply))
            simulator.state()
            simulator.observe()

    return run


def bare_stepping(task: Task, actions: FloatArray):
    """Does the same physics on the model as loaded, all sensors included, and reads nothing."""
    model = mujoco.MjModel.from_xml_path(str(task.model_path))
    model.actuator_gainprm[:] = task.model.actuator_gainprm
    model.actuator_biasprm[:] = task.model.actuator_biasprm
    batch = Batch(model, CHUNK)
    task.place(batch, task.sample("test", CHUNK).values)
    low, high = model.actuator_ctrlrange.T
    controls = cycle((low + high) / 2 + actions * (high - low) / 2)

    def run() -> None:
        for _ in range(STEPS):
            batch.ctrl[:] = next(controls)
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
    actions = random_actions(task, CHUNK, 20 * STEPS)
    ours, bare = stepping(task, actions), bare_stepping(task, actions)
    compare(f"simulator_vs_bare[{task.name}]", ours, bare, 0.90, (STEPS * CHUNK,) * 2)


@pytest.mark.parametrize("kind", ["sync", "async"])
def test_against_gymnasium_vector_environments(task, kind, compare):
    ours = stepping(task, random_actions(task, CHUNK, 20 * STEPS))
    run, envs, steps = vector_stepping(task, kind)
    compare(f"simulator_vs_{kind}[{task.name}]", ours, run, 1.0, (STEPS * CHUNK, steps))
    envs.close()


# Rollouts
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
    weights = train_controller(ControllerConfig(epochs=1), motions[:16], task.name)
    return TrackedMotion(Recorded(motions), Controller(weights))


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


def driven(task: Task, policy: TrackedMotion):
    starts = task.sample("test", CHUNK)
    return lambda: rollout(task, starts, policy, steps=DRIVEN, whole=True)


def test_a_rollout_against_bare_batch_step(task, tracked, compare):
    actions = random_actions(task, CHUNK, 20 * STEPS)
    ours, bare = driven(task, tracked), bare_stepping(task, actions)
    work = (DRIVEN * CHUNK, STEPS * CHUNK)
    compare(f"rollout_vs_bare[{task.name}]", ours, bare, 1.0, work)


def test_a_rollout_against_the_authors_loop(task, tracked, compare):
    work = (DRIVEN * CHUNK, VECTOR_STEPS)
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
