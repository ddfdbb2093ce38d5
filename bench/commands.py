"""Commands that installed packages bring, by entry points of the group ``bench.commands``."""

from collections.abc import Callable, Sequence
from importlib.metadata import EntryPoint
from typing import Any

import typer

from tasks.errors import InputError, described
from tasks.packages import entry_points_of, owners

FAULTS: dict[str, str] = {}
"""Why a command cannot be used, by name."""


def add_commands(app: typer.Typer) -> None:
    """Adds the commands of packages to a command line that has its own already.

    A command that cannot be used says why when it is called, and leaves the others alone. One with
    the name of the command line's own is left out.
    """
    own = {command.name for command in app.registered_commands}
    own |= {group.name for group in app.registered_groups}
    brought: dict[str, list[EntryPoint]] = {}
    for point in entry_points_of("bench.commands"):
        brought.setdefault(point.name, []).append(point)
    for name, points in sorted(brought.items()):
        if name in own:
            packages = owners(points)
            FAULTS[name] = f"{packages} brings a command {name!r}, which bench has: uninstall it"
        else:
            _add(app, name, points)


def _add(app: typer.Typer, name: str, points: Sequence[EntryPoint]) -> None:
    packages = owners(points)
    if len(points) > 1:
        FAULTS[name] = f"{packages} bring the same command {name!r}: uninstall all but one"
    else:
        try:
            app.command(name)(_checked(points[0]))
            return
        except BaseException as error:  # whatever a module raises: it may call sys.exit
            FAULTS[name] = (
                f"command {name!r} of {packages} cannot be imported: {described(error)}; repair or"
                f" uninstall {packages}"
            )
    anything = {"allow_extra_args": True, "ignore_unknown_options": True}
    app.command(name, context_settings=anything)(_failing(FAULTS[name]))


def _checked(point: EntryPoint) -> Callable[..., Any]:
    """What an entry point names, once it is known that a command can be made of it."""
    found: Callable[..., Any] = point.load()
    alone = typer.Typer()
    alone.command(point.name)(found)
    typer.main.get_command(alone)
    return found


def _failing(fault: str) -> Callable[[], None]:
    def fail() -> None:
        """Cannot be used: call it to see why."""
        raise InputError(fault)

    return fail
