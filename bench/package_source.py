"""The source of packages that bring methods and tasks, as SHA-256. Nothing of it is imported."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path

from methods.registry import ENTRY_POINTS, SUITE, package_methods, unknown_method
from tasks.errors import InputError, described
from tasks.packages import entry_points_of, owners
from tasks.registry import ENTRY_POINTS as TASK_ENTRY_POINTS
from tasks.registry import TASKS, package_tasks

_COMPILED = "__pycache__"


@dataclass(frozen=True)
class PackageSource:
    """An installed package that provides a method."""

    name: str
    version: str
    files: Mapping[str, str]
    """The SHA-256 of each file of its modules, by path."""

    def difference(self, other: "PackageSource") -> str:
        """Returns the first file in which another source of the package differs, or nothing."""
        for path in sorted({*self.files, *other.files}):
            if self.files.get(path) != other.files.get(path):
                return path
        return ""


def package_source(method: str) -> PackageSource:
    """Returns the source of the package that provides a method.

    Its modules are that of the entry point and those that the package names as its own. Hidden and
    compiled files do not count.

    Raises:
        InputError: no installed package provides the method, or its files cannot be read.
    """
    if method not in package_methods():
        raise unknown_method(method)
    (point,) = (one for one in entry_points_of(ENTRY_POINTS) if one.name == method)
    try:
        modules = _modules(point)
        files = {name: _digest(path) for module in modules for name, path in _files(module)}
    except (ImportError, OSError, ValueError) as error:
        raise InputError(
            f"the source of {owners([point])} cannot be read: {described(error)}"
        ) from error
    return PackageSource(owners([point]), point.dist.version if point.dist else "", files)


def code_of(*names: str) -> dict[str, str]:
    """Returns, by the name of a method or a task, a SHA-256 of the Python files of its package.

    Names of the suite's own are left out, and those of packages that are not installed or cannot be
    read. Other files do not count, since a package may hold gigabytes of them.
    """
    brought = {*names} - {*SUITE, *TASKS}
    if not brought:
        return {}
    brought &= {*package_methods(), *package_tasks()}
    points = [*entry_points_of(ENTRY_POINTS), *entry_points_of(TASK_ENTRY_POINTS)]
    found = {point.name: _code(point) for point in points if point.name in brought}
    return {name: digest for name, digest in found.items() if digest}


def _code(point: EntryPoint) -> str:
    try:
        files = [one for module in _modules(point) for one in _files(module)]
        digests = [(name, _digest(path)) for name, path in files if path.suffix == ".py"]
    except (ImportError, OSError, ValueError):
        return ""
    return hashlib.sha256(repr(digests).encode()).hexdigest()


def _modules(point: EntryPoint) -> list[str]:
    """Returns the top-level modules of an entry point's package."""
    named = (point.dist and point.dist.read_text("top_level.txt")) or ""
    return sorted({point.module.partition(".")[0], *named.split()})


def _files(module: str) -> Iterator[tuple[str, Path]]:
    """Yields the files of a top-level module, each with its path from the module's folder."""
    spec = find_spec(module)
    if spec is None:
        raise ImportError(f"there is no module {module}")
    folders = list(spec.submodule_search_locations or ())
    if not folders:
        path = Path(spec.origin or "")
        yield path.name, path
    for folder in map(Path, folders):
        for path in sorted(folder.rglob("*")):
            parts = path.relative_to(folder).parts
            hidden = any(part.startswith(".") or part == _COMPILED for part in parts)
            if path.is_file() and not hidden:
                yield "/".join((module, *parts)), path


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
