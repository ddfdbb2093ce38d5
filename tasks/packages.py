"""Entry points of installed packages."""

from collections.abc import Iterable
from importlib.metadata import Distribution, EntryPoint, distributions, entry_points

from tasks.errors import described

NAMELESS = "a package without a name"


def entry_points_of(group: str) -> list[EntryPoint]:
    """Returns the entry points of a group, except those of `unreadable` packages."""
    try:
        return list(entry_points(group=group))
    except Exception:
        lists = [points for points in _by_package().values() if isinstance(points, list)]
        return [point for points in lists for point in points if point.group == group]


def unreadable() -> dict[str, str]:
    """Returns the packages whose entry points cannot be read, each with the reason."""
    found = _by_package().items()
    return {name: described(error) for name, error in found if isinstance(error, Exception)}


def owners(points: Iterable[EntryPoint]) -> str:
    """Returns the names of the packages that define entry points, joined for a message."""
    return " and ".join(sorted({_name(point.dist) for point in points}))


def _by_package() -> dict[str, list[EntryPoint] | Exception]:
    found: dict[str, list[EntryPoint] | Exception] = {}
    for package in distributions():
        name = _name(package)
        if name not in found:
            try:
                found[name] = list(package.entry_points)
            except Exception as error:
                found[name] = error
    return found


def _name(package: Distribution | None) -> str:
    try:
        return (package and package.name) or NAMELESS
    except Exception:
        return NAMELESS
