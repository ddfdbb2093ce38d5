"""Tasks by name, each imported when it is first asked for."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

from tasks.errors import unknown_name

if TYPE_CHECKING:
    from tasks.base import Task

_CLASSES = {
    "tool": "Tool",
    "door": "Door",
    "relocation": "Relocation",
    "reorientation": "Reorientation",
}
TASKS = tuple(_CLASSES)


@cache
def get_task(name: str) -> Task:
    """Returns the task of that name.

    Raises:
        InputError: there is no such task.
    """
    if name not in _CLASSES:
        raise unknown_name("task", name, TASKS)
    task: Task = getattr(import_module(f"tasks.{name}"), _CLASSES[name])()
    return task
