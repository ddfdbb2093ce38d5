"""The particulars of what can be run, as plain dictionaries."""

from dataclasses import asdict
from typing import Any

from tasks.base import SPLITS, Range, Task
from tasks.masses import NOMINAL, all_changes
from tasks.registry import get_task


def describe(name: str) -> dict[str, Any]:
    """Returns the particulars of a task.

    Raises:
        InputError: there is no task of that name.
    """
    task = get_task(name)
    return {
        "name": task.name,
        "summary": task.summary,
        "version": task.version,
        "robot_dim": task.layout.robot_dim,
        "object_dim": task.layout.object_dim,
        "action_dim": task.layout.action_dim,
        "horizon": task.horizon,
        "components": [asdict(component) for component in task.components],
        "starts": [asdict(component) for component in task.start_components],
        "splits": {split: [_limits(task, box) for box in task.ranges(split)] for split in SPLITS},
        "reading": asdict(task.reading),
        "success": task.rule,
        "physics": {NOMINAL: None} | {name: asdict(c) for name, c in all_changes(name).items()},
        "model_file": task.model_file,
        "model_hash": task.model_hash,
    }


def _limits(task: Task, box: Range) -> dict[str, list[float]]:
    names = [component.name for component in task.start_components]
    limits = zip(names, box.low, box.high, strict=True)
    return {name: [low, high] for name, low, high in limits}
