"""What a perfect imitation would have in changed physics: the expert's own motions, tracked.

Where the expert's own motions fail under a controller, no method could have done better by
imitating them.
"""

from typing import Any

from bench.controller import Controller, ControllerConfig, train_controller
from bench.driver import controller_demos
from bench.probe import Recorded
from bench.rollout import TrackedMotion
from bench.spec import ControllerSpec
from tasks.base import Task
from tasks.demos import TRAINING, demos_key, record
from tasks.experts import load_expert
from tasks.masses import NOMINAL
from tasks.simulator import rollout


def track(
    task: Task, physics: str, episodes: int, config: ControllerConfig
) -> list[dict[str, Any]]:
    """Returns the success in changed physics of the expert's motions, made there and in nominal.

    One row for each of both motions and controllers (appendix I): ``motions``, the physics that
    they were made in, ``controller``, ``success`` as a fraction, ``episodes``.

    Args:
        task: what is done.
        physics: a variation of appendix I, or another reading of one.
        episodes: starts of ``test``, from the first.
        config: how both controllers are trained.
    """
    expert, starts = load_expert(task).policy, task.sample("test", episodes)
    specs = [
        ControllerSpec(task.name, config, TRAINING, demos_key(task), learnt)
        for learnt in (NOMINAL, physics)
    ]
    controllers = {
        spec.name: Controller(train_controller(config, controller_demos(spec), task.name))
        for spec in specs
    }
    rows = []
    for made in (NOMINAL, physics):
        motions = Recorded(record(task, starts, expert, made, failures=True)[1])
        for name, controller in controllers.items():
            found = rollout(task, starts, TrackedMotion(motions, controller), physics)
            rate = float(found.success.mean())
            rows.append(
                {"motions": made, "controller": name, "success": rate, "episodes": episodes}
            )
    return rows
