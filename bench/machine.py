"""The speed of this machine, relative to the reference machine of bench/costs.csv."""

import json
import os
import platform
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from time import process_time

import numpy as np
from threadpoolctl import threadpool_limits

from bench.controller import ControllerConfig, train_controller
from bench.costs import calibration_seconds
from tasks.cache import cache_folder
from tasks.data import Demos, Starts, generator, key
from tasks.errors import InputError
from tasks.experts import load_expert
from tasks.files import whole_file
from tasks.pins import processor
from tasks.registry import get_task
from tasks.simulator import rollout

TRAINING, VALIDATION, EPISODES = 16, 4, 50
"""Numbers of demonstrations and episodes of the calibration."""


def machine_factor() -> float:
    """Returns how many seconds this machine takes for one second of the reference machine.

    The first call measures it, in a few seconds. The cache keeps it for this machine and these
    versions.
    """
    known = cached_factor()
    if known is not None:
        return known
    factor = calibrate() / calibration_seconds()
    with suppress(OSError, InputError), whole_file(_path()) as file:
        file.write_text(json.dumps({"factor": factor}))
    return factor


def cached_factor() -> float | None:
    """Returns `machine_factor` if the cache has it, else None."""
    try:
        factor = float(json.loads(_path().read_bytes())["factor"])
    except (OSError, ValueError, KeyError, TypeError, InputError):
        return None
    return factor if 0 < factor < float("inf") else None


def describe_machine() -> str:
    """Returns processor, cores and versions in one line."""
    names = ("mujoco", "numpy", "torch")
    versions = ", ".join(f"{name} {version(name)}" for name in names)
    name = processor()[0] or platform.processor() or platform.machine()
    return f"{name}, {os.cpu_count()} cores; Python {platform.python_version()}, {versions}"


def _path() -> Path:
    this = key(platform.node(), describe_machine(), version("kodex-bench"), calibration_seconds())
    return cache_folder() / "machine" / f"{this[:16]}.json"


def calibrate() -> float:
    """Returns the CPU seconds of a sample of what jobs do: simulate and train networks."""
    task = get_task("door")
    starts, expert, (demos, validation) = (
        task.sample("train", EPISODES),
        load_expert(task).policy,
        random_demos("door"),
    )
    warm_up()
    with threadpool_limits(1):
        began = process_time()
        rollout(task, starts, expert, chunk=EPISODES, threads=1, whole=True)
        train_controller(ControllerConfig(epochs=20), demos, "calibration", 1)
        _fit_lstm(demos, validation)
        return process_time() - began


def _fit_lstm(demos: Demos, validation: Demos) -> None:
    from methods.base import shortened
    from methods.lstm import LSTM

    config = shortened(LSTM.sizes["median"], 10)
    LSTM(config, get_task("door").layout).fit(demos, validation, 1)


@cache
def warm_up() -> None:
    """Trains once, since the first training of a process also imports torch and gets memory."""
    train_controller(ControllerConfig(epochs=1), random_demos("door")[0], "calibration", 1)


@cache
def random_demos(task_name: str) -> tuple[Demos, Demos]:
    """Returns random demonstrations of a task's dimensions: 16 for training, 4 for validation."""
    task = get_task(task_name)
    rng = generator("calibration", task_name)
    count = TRAINING + VALIDATION
    shape = (count, task.horizon)
    # Random walks: the velocities of plain noise would make a second-order policy diverge.
    states = rng.standard_normal((*shape, task.layout.state_dim)).cumsum(axis=1) / task.horizon
    velocities = states[:, :, : task.robot_dim]
    actions = rng.uniform(-1, 1, (count, task.steps, task.layout.action_dim))
    starts = Starts(task_name, "demo", np.arange(count), np.zeros((count, 1)))
    demos = Demos(starts, states, velocities, actions)
    return demos[:TRAINING], demos[TRAINING:]
