"""Environment steps a second of the simulator against its peers."""

import os
from functools import partial
from itertools import cycle

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from tasks.base import Task
from tasks.data import FloatArray, generator
from tasks.registry import TASKS, get_task
from tasks.simulator import CHUNK, SUBSTEPS, Simulator

STEPS = 10
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
