"""Entry points of installed packages, which bring methods, tasks and commands."""

from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from importlib.metadata import Distribution, EntryPoint, distributions, entry_points
from typing import Any

from tasks.errors import InputError, described, printable, unknown_name
from tasks.names import check_name

NAMELESS = "a package without a name"


class PackageError(InputError):
    """A method or task of a package cannot be used; the message gives the reason."""


@dataclass(frozen=True)
class Group:
    """The entry points of a group: the name of each is that of a class, which is its value."""

    name: str
    """Such as ``bench.methods``."""
    kind: str
    """What the classes are: ``method`` or ``task``."""
    suite: Collection[str]
    """The names of the suite's own, which no package can replace."""

    def usable(self) -> list[str]:
        """Returns the names in packages, except `unusable` ones. Imports nothing."""
        return sorted(set(self._points()) - set(self.unusable()))

    def unusable(self) -> dict[str, str]:
        """Returns the unusable names in packages, with the reason. Imports nothing.

        It includes a name of the suite if a package has it too. The suite's is used.
        """
        found = {name: self._fault(name, points) for name, points in self._points().items()}
        return {name: fault for name, fault in found.items() if fault}

    def unknown(self, name: str, known: Iterable[str]) -> InputError:
        """Returns the error for a name that is not known, with the reason if it is unusable."""
        faults = self.unusable()
        return (
            PackageError(faults[name]) if name in faults else unknown_name(self.kind, name, known)
        )

    def load(
        self,
        name: str,
        fault_of: Callable[[object, str], str],
        within: AbstractContextManager[Any],
    ) -> Any:
        """Imports and returns the class of a `usable` name.

        Args:
            name: the name.
            fault_of: says why an object is no class of that name, or returns an empty text.
            within: the import happens in this context.

        Raises:
            PackageError: it cannot be imported, or has a fault.
        """
        (point,) = self._points()[name]
        package = owners([point])
        value = printable(lambda: point.value, "", 100)
        place = f"{self.kind} {name!r} ({value}) of {package}"
        cure = f"repair or uninstall {package}"
        try:
            with within:
                found = point.load()
                fault = fault_of(found, name)
        except BaseException as error:  # a module may raise anything, or call sys.exit
            raise PackageError(f"{place} cannot be imported: {described(error)}; {cure}") from error
        if fault:
            raise PackageError(f"{place} cannot be used: {fault}; {cure}")
        return found

    def _points(self) -> dict[str, list[EntryPoint]]:
        found: dict[str, list[EntryPoint]] = {}
        for point in entry_points_of(self.name):
            found.setdefault(point.name, []).append(point)
        return found

    def _fault(self, name: str, points: Sequence[EntryPoint]) -> str:
        """Why a class of packages cannot be used, judged by its name; empty if it can."""
        packages = owners(points)
        cure = f"uninstall {packages}, or rename its entry point"
        if name in self.suite:
            return f"{packages} provides a {self.kind} {name!r}, which this suite has: {cure}"
        try:
            check_name(self.kind, name)
        except InputError as error:
            return f"{packages} provides a {self.kind} that cannot be used: {error}; {cure}"
        if len(points) > 1:
            values = ", ".join(sorted(point.value for point in points))
            return (
                f"{packages} provide the same {self.kind} {name!r} ({values}): uninstall all but"
                " one"
            )
        return ""


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
