"""Tracks the expert's own motions, to measure what a perfect imitation would achieve.

If the expert's motions fail under a controller, a method that imitates them cannot do better.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from bench.controller import Controller, ControllerConfig, train_controllers
from bench.controller_kinds import ORIGINAL, TUNED
from bench.doing import say
from bench.probe import Recorded
from bench.rollout import TrackedMotion
from bench.spec import ControllerSpec
from bench.training_data import controller_demos
from tasks.base import Task
from tasks.demos import TRAINING, demos_key
from tasks.experts import load_expert
from tasks.masses import NOMINAL
from tasks.recorder import record
from tasks.registry import FIRST
from tasks.simulator import rollout


def track(
    task: Task,
    physics: str,
    episodes: int,
    config: ControllerConfig,
    seeds: Sequence[int],
    expert: str = FIRST,
) -> list[dict[str, Any]]:
    """Returns how often controllers succeed in some physics when they track the expert's motions.

    Each row has ``seed``, ``motions`` (the physics in which the expert's motions were recorded),
    ``controller``, ``success`` as a fraction, and ``episodes``. There are motions of nominal
    physics and of the given one. The controllers are the original one and, in changed physics, the
    tuned one (appendix I).

    Args:
        task: the task.
        physics: nominal, a variation of appendix I, or another reading of one.
        episodes: number of starts of ``test`` of each seed, from the first.
        config: training settings of the controllers.
        seeds: of a study, each with its own starts and controllers.
        expert: which of the task's experts.
    """
    policy, rows = load_expert(task, expert).policy, []
    controllers = _controllers(task, physics, config, seeds, expert)
    for seed in seeds:
        starts = task.sample("test", episodes, seed)
        for made in dict.fromkeys((NOMINAL, physics)):
            say(f"recording the expert's motions in {made} physics")
            motions = Recorded(record(task, starts, policy, made, failures=True)[1])
            for kind, of_seed in controllers.items():
                say(f"tracking motions of {made} physics with the controller {kind}")
                found = rollout(task, starts, TrackedMotion(motions, of_seed[seed]), physics)
                rows.append(
                    {
                        "seed": seed,
                        "motions": made,
                        "controller": kind,
                        "success": float(found.success.mean()),
                        "episodes": episodes,
                    }
                )
    return rows


def _controllers(
    task: Task, physics: str, config: ControllerConfig, seeds: Sequence[int], expert: str
) -> dict[str, dict[int, Controller]]:
    """The controllers by kind and seed."""
    key = demos_key(task, expert)
    original = ControllerSpec(task.name, ORIGINAL, config, TRAINING, key, seeds[0])
    kinds = [original]
    if physics != NOMINAL:
        kinds.append(replace(original, kind=TUNED, physics=physics))
    found = {}
    for spec in kinds:
        say(f"training {spec.kind} controllers of {task.name}")
        demos = [controller_demos(replace(spec, seed=seed)) for seed in seeds]
        weights = train_controllers(config, demos, task.name, seeds)
        found[spec.kind] = dict(zip(seeds, map(Controller, weights), strict=True))
    return found
