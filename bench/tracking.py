"""Tracks the expert's own motions, to measure what a perfect imitation would achieve.

If the expert's motions fail under a controller, a method that imitates them cannot do better.
"""

from dataclasses import replace
from typing import Any

from bench.controller import Controller, ControllerConfig, train_controller
from bench.controller_kinds import ORIGINAL, RESEEDED, TUNED
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
from tasks.simulator import rollout


def track(
    task: Task, physics: str, episodes: int, config: ControllerConfig
) -> list[dict[str, Any]]:
    """Returns how often controllers succeed in some physics when they track the expert's motions.

    Each row has ``motions`` (the physics in which the expert's motions were recorded),
    ``controller``, ``success`` as a fraction, and ``episodes``. There are motions of nominal
    physics and of the given one. In changed physics the controllers are the original and the tuned
    one (appendix I). In nominal physics they are the original one and those that differ from it
    only in their random numbers.

    Args:
        task: the task.
        physics: nominal, a variation of appendix I, or another reading of one.
        episodes: number of starts of ``test``, from the first.
        config: training settings of the controllers.
    """
    expert, starts = load_expert(task).policy, task.sample("test", episodes)
    original = ControllerSpec(task.name, ORIGINAL, config, TRAINING, demos_key(task))
    if physics == NOMINAL:
        specs = [original, *(replace(original, seed=seed) for seed in RESEEDED)]
    else:
        specs = [original, replace(original, kind=TUNED, physics=physics)]
    controllers = {}
    for spec in specs:
        say(f"training the controller {spec.label}")
        weights = train_controller(config, controller_demos(spec), task.name, spec.seed)
        controllers[spec.name] = Controller(weights)
    rows = []
    for made in dict.fromkeys((NOMINAL, physics)):
        say(f"recording the expert's motions in {made} physics")
        motions = Recorded(record(task, starts, expert, made, failures=True)[1])
        for name, controller in controllers.items():
            say(f"tracking motions of {made} physics with the controller {name}")
            found = rollout(task, starts, TrackedMotion(motions, controller), physics)
            rate = float(found.success.mean())
            rows.append(
                {"motions": made, "controller": name, "success": rate, "episodes": episodes}
            )
    return rows
