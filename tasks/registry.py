"""Tasks by name. A task's module is imported when it is first used."""

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
APPENDIX, PUBLISHED = "appendix", "published"
"""Success rules: that of appendix C, and that of the published code."""
JUDGED_OTHERWISE = {"tool": "PublishedTool", "reorientation": "PublishedReorientation"}
"""Tasks for which the published code has another success rule than appendix C."""


def get_task(name: str, rule: str = APPENDIX) -> Task:
    """Returns the task of a name, with a success rule.

    Raises:
        InputError: there is no such task, or the task has no such rule.
    """
    if name not in _CLASSES:
        raise unknown_name("task", name, TASKS)
    if rule not in rules(name):
        raise unknown_name(f"rule of {name}", rule, rules(name))
    return _made(name, _CLASSES[name] if rule == APPENDIX else JUDGED_OTHERWISE[name])


def rules(name: str) -> tuple[str, ...]:
    """Returns the names of a task's success rules."""
    return (APPENDIX, PUBLISHED) if name in JUDGED_OTHERWISE else (APPENDIX,)


@cache
def _made(name: str, kind: str) -> Task:
    task: Task = getattr(import_module(f"tasks.{name}"), kind)()
    return task
