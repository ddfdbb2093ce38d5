"""Tasks of packages: each is tried in a process of its own before this process imports it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

from bench.isolation import apart
from tasks.errors import InputError
from tasks.registry import get_task, package_tasks

if TYPE_CHECKING:
    from tasks.base import Task


def known_task(name: str) -> Task:
    """Returns the task of a name. A package's is first tried elsewhere: it may end the process.

    Raises:
        InputError: there is no such task, or it cannot be used.
    """
    if name in package_tasks():
        check_free(name)
        _try(name)
    return get_task(name)


def check_free(name: str) -> None:
    """Raises InputError if the name of a task is also that of something else."""
    if name in names_beside_tasks():
        raise InputError(
            f"task {name!r} of a package has the name of a method, an experiment or a preset:"
            " rename its entry point and its class, or uninstall the package"
        )


def names_beside_tasks() -> list[str]:
    """Returns the names of methods, experiments and presets."""
    from bench.presets import PRESETS, experiment_names
    from methods.registry import method_names

    return [*method_names(), *experiment_names(), *PRESETS]


def use_apart(use: Callable[[str], None], name: str) -> None:
    """Calls a function with the name of a task in a process of its own.

    Raises:
        InputError: it fails there; the message names the task.
    """
    try:
        apart(use, name)
    except InputError as error:
        raise InputError(f"task {name!r} cannot be used: {error}") from error


@cache
def _try(name: str) -> None:
    use_apart(_use, name)


def _use(name: str) -> None:
    from tasks.experts import experts_of
    from tasks.simulator import Simulator

    task = get_task(name)
    simulator = Simulator(task, task.sample("test", 1))
    simulator.state()
    task.read(simulator.batch)
    experts_of(task)
