"""Commands that installed packages provide as entry points of ``bench.commands``."""

from collections.abc import Callable, Sequence
from importlib.metadata import EntryPoint
from typing import Any

import typer

from tasks.errors import InputError, described
from tasks.packages import entry_points_of, owners

FAULTS: dict[str, str] = {}
"""By name of a command, why it cannot be used."""


def add_commands(app: typer.Typer) -> None:
    """Adds the commands of packages to a command line that has its own commands already.

    A command that cannot be used says why when it is called; the others work. A command with the
    name of one of the command line's own is left out.
    """
    own = {command.name for command in app.registered_commands}
    own |= {group.name for group in app.registered_groups}
    brought: dict[str, list[EntryPoint]] = {}
    for point in entry_points_of("bench.commands"):
        brought.setdefault(point.name, []).append(point)
    for name, points in sorted(brought.items()):
        if name in own:
            packages = owners(points)
            FAULTS[name] = f"{packages} provides a command {name!r}, which bench has: uninstall it"
        else:
            _add(app, name, points)


def _add(app: typer.Typer, name: str, points: Sequence[EntryPoint]) -> None:
    packages = owners(points)
    if len(points) > 1:
        FAULTS[name] = f"{packages} provide the same command {name!r}: uninstall all but one"
    else:
        try:
            app.command(name)(_checked(points[0]))
            return
        except (Exception, SystemExit) as error:
            FAULTS[name] = (
                f"command {name!r} of {packages} cannot be imported: {described(error)}; repair or"
                f" uninstall {packages}"
            )
    anything = {"allow_extra_args": True, "ignore_unknown_options": True}
    app.command(name, context_settings=anything)(_failing(FAULTS[name]))


def _checked(point: EntryPoint) -> Callable[..., Any]:
    """The object of an entry point, after checking that it can become a command."""
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
