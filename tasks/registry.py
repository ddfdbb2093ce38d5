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
APPENDIX, PUBLISHED = "appendix", "published"
"""Whose rule decides on success: appendix C's, or that of the published code."""
JUDGED_OTHERWISE = {"tool": "PublishedTool", "reorientation": "PublishedReorientation"}
"""The tasks whose success the published code judges by another rule than appendix C."""


def get_task(name: str, rule: str = APPENDIX) -> Task:
    """Returns the task of that name, with success judged by that rule.

    Raises:
        InputError: there is no such task, or the rule is not one of `rules`.
    """
    if name not in _CLASSES:
        raise unknown_name("task", name, TASKS)
    if rule not in rules(name):
        raise unknown_name(f"rule of {name}", rule, rules(name))
    return _made(name, _CLASSES[name] if rule == APPENDIX else JUDGED_OTHERWISE[name])


def rules(name: str) -> tuple[str, ...]:
    """Returns the rules by which the success of a task can be judged."""
    return (APPENDIX, PUBLISHED) if name in JUDGED_OTHERWISE else (APPENDIX,)


@cache
def _made(name: str, kind: str) -> Task:
    task: Task = getattr(import_module(f"tasks.{name}"), kind)()
    return task
