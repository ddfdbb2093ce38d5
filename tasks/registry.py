"""Tasks by name: those of this suite and those of installed packages.

A package registers a task as an entry point of the group ``bench.tasks``: its name is the task's,
and its value the class. A task's module is imported when it is first used.
"""

from __future__ import annotations

from contextlib import nullcontext
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

from tasks.errors import InputError, unknown_name
from tasks.packages import Group

if TYPE_CHECKING:
    from tasks.base import Task

_CLASSES = {
    "tool": "Tool",
    "door": "Door",
    "relocation": "Relocation",
    "reorientation": "Reorientation",
}
TASKS = tuple(_CLASSES)
"""The tasks of this suite. Tasks of packages are used only if they are named."""
APPENDIX, PUBLISHED = "appendix", "published"
"""Success rules: that of appendix C, and that of the published code."""
EXPERTS = FIRST, SECOND = ("first", "second")
"""The experts of a task. A task of a package has only the first."""
JUDGED_OTHERWISE = {"tool": "PublishedTool", "reorientation": "PublishedReorientation"}
"""Tasks for which the published code has another success rule than appendix C."""

ENTRY_POINTS = "bench.tasks"
_BROUGHT = Group(ENTRY_POINTS, "task", TASKS)


def task_names() -> list[str]:
    """Returns the names of all tasks, those of this suite first."""
    return [*TASKS, *package_tasks()]


def package_tasks() -> list[str]:
    """Returns the names of the tasks in packages, except `unusable_tasks`."""
    return _BROUGHT.usable()


def unusable_tasks() -> dict[str, str]:
    """Returns the unusable tasks of packages by name, with the reason. Imports nothing."""
    return _BROUGHT.unusable()


def unknown_task(name: str) -> InputError:
    """Returns the error for a name not in `task_names`, with the reason if it is unusable."""
    return _BROUGHT.unknown(name, task_names())


def get_task(name: str, rule: str = APPENDIX) -> Task:
    """Returns the task of a name, with a success rule.

    Raises:
        PackageError: the task of a package cannot be used.
        InputError: there is no such task, or the task has no such rule.
    """
    if name not in TASKS:
        return _of_package(name, rule)
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


@cache
def _of_package(name: str, rule: str) -> Task:
    if name not in package_tasks():
        raise unknown_task(name)
    if rule != APPENDIX:
        raise unknown_name(f"rule of {name}", rule, (APPENDIX,))
    found: type[Task] = _BROUGHT.load(name, class_fault, nullcontext())
    return found()


def class_fault(found: object, name: str) -> str:
    """Returns why an object is not the class of a task of that name, or an empty text."""
    from tasks.base import REQUIRED, Task  # imports MuJoCo
    from tasks.names import word_fault

    if not (isinstance(found, type) and issubclass(found, Task)):
        return f"it must be a subclass of tasks.base.Task, got a {type(found).__name__}"
    lacks = [*found.__abstractmethods__, *(one for one in REQUIRED if not hasattr(found, one))]
    if lacks:
        return f"the class lacks {', '.join(sorted(lacks))}"
    if found.name != name:
        return f"the class must have the name {name!r}, as its entry point has"
    if not callable(found.expert):
        return f"expert must be a method, got {found.expert!r}: leave it out if there is none"
    for change in found.changes:
        if fault := word_fault(change):
            return f"one of its changes cannot be called {change!r}: {fault}"
    return ""
