"""Methods by name: those of this suite and those of installed packages.

A package registers a method as an entry point of the group ``bench.methods``: its name is the
method's, and its value the class.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint

from methods.base import ActionMethod, Method, MotionMethod
from methods.names import check_label, check_method_name
from tasks.errors import InputError, described, printable, unknown_name
from tasks.packages import entry_points_of, owners

ENTRY_POINTS = "bench.methods"
_CLASSES = {
    "kodex": "Kodex",
    "nn": "NN",
    "lstm": "LSTM",
    "ndp": "NDP",
    "ngf": "NGF",
    "nearest": "Nearest",
    "regression": "Regression",
    "bc": "BC",
    "chunk": "Chunk",
    "flow": "Flow",
}
SUITE = tuple(_CLASSES)
"""The methods of this suite. Methods of packages are used only if they are named."""
TO_BEAT = ("nearest", "regression")
"""The methods among them that learn next to nothing: what a method has to beat."""
CLOSED_LOOP = ("bc", "chunk", "flow")
"""The methods that see what happens and choose an action in each state."""
PAPER = tuple(name for name in SUITE if name not in (*TO_BEAT, *CLOSED_LOOP))
"""The methods of the paper."""
_VARIANTS = {("ngf", "published"): ("ngf_published", "PublishedNGF")}
"""Variants with a class of their own."""


_INTRODUCED: dict[str, type[Method]] = {}
"""Stand-ins by name, for methods that this process must not import."""


class MethodError(InputError):
    """A package's method cannot be used; the message gives the reason."""


def method_names() -> list[str]:
    """Returns the names of all methods, those of this suite first."""
    return [*_CLASSES, *package_methods()]


def package_methods() -> list[str]:
    """Returns the names of the methods in packages, except `unusable` ones."""
    return sorted(set(_brought()) - set(unusable()))


def unusable() -> dict[str, str]:
    """Returns the unusable methods of packages by name, with the reason. Imports nothing.

    It includes a name of the suite if a package has a method of that name. The suite's is used.
    """
    found = {name: _fault(name, points) for name, points in _brought().items()}
    return {name: fault for name, fault in found.items() if fault}


def unknown_method(name: str) -> InputError:
    """Returns the error for a name not in `method_names`, with the reason if it is unusable."""
    faults = unusable()
    if name in faults:
        return MethodError(faults[name])
    return unknown_name("method", name, method_names())


@cache
def get_method(name: str, variant: str = "described") -> type[Method]:
    """Returns the class of a method's variant. It is imported when it is first used.

    Raises:
        MethodError: the method of a package cannot be used.
        InputError: there is no such method.
    """
    if name in _INTRODUCED:
        return _INTRODUCED[name]
    if name not in method_names():
        raise unknown_method(name)
    if name in _CLASSES:
        return variant_class(_imported(name, _CLASSES[name]), variant)
    return _load(*_brought()[name])


def variant_class(method: type[Method], variant: str) -> type[Method]:
    """Returns the class of a method's variant: the method itself, unless it is in `_VARIANTS`."""
    own = method.__module__ == f"methods.{method.name}"
    place = _VARIANTS.get((method.name, variant)) if own else None
    return _imported(*place) if place else method


def _imported(module: str, class_name: str) -> type[Method]:
    found: type[Method] = getattr(import_module(f"methods.{module}"), class_name)
    return found


@contextmanager
def introduced() -> Iterator[Callable[[type[Method]], None]]:
    """Yields a function that registers a stand-in for a method until the block ends.

    See `methods.description`.
    """

    def introduce(method: type[Method]) -> None:
        _INTRODUCED[method.name] = method
        get_method.cache_clear()

    try:
        yield introduce
    finally:
        _INTRODUCED.clear()
        get_method.cache_clear()


def _brought() -> dict[str, list[EntryPoint]]:
    """The entry points of packages, by the name of the method."""
    found: dict[str, list[EntryPoint]] = {}
    for point in entry_points_of(ENTRY_POINTS):
        found.setdefault(point.name, []).append(point)
    return found


def _fault(name: str, points: Sequence[EntryPoint]) -> str:
    """Why a method of packages cannot be used, judged by its name; empty if it can."""
    packages = owners(points)
    if name in _CLASSES:
        return f"{packages} provides a method {name!r}, which this suite has: {_cure(packages)}"
    try:
        check_method_name(name)
    except InputError as error:
        return f"{packages} provides a method that cannot be used: {error}; {_cure(packages)}"
    if len(points) > 1:
        values = ", ".join(sorted(point.value for point in points))
        return f"{packages} provide the same method {name!r} ({values}): uninstall all but one"
    return ""


def _cure(packages: str) -> str:
    return f"uninstall {packages}, or rename its entry point"


def _load(point: EntryPoint) -> type[Method]:
    from methods.guard import guarded  # imports torch, which `bench list` does not need

    package = owners([point])
    value = printable(lambda: point.value, "", 100)
    place, cure = f"method {point.name!r} ({value}) of {package}", f"repair or uninstall {package}"
    try:
        with guarded("import", point.name):
            found = point.load()
            fault = class_fault(found, point.name)
    except BaseException as error:  # a module may raise anything, or call sys.exit
        raise MethodError(f"{place} cannot be imported: {described(error)}; {cure}") from error
    if fault:
        raise MethodError(f"{place} cannot be used: {fault}; {cure}")
    return found


def class_fault(found: object, name: str) -> str:
    """Returns why an object is not the class of a method of that name, or an empty text."""
    kinds = (MotionMethod, ActionMethod)
    if not (isinstance(found, type) and issubclass(found, kinds)):
        return (
            f"it must be a subclass of MotionMethod or ActionMethod, got a {type(found).__name__}"
        )
    if issubclass(found, MotionMethod) and issubclass(found, ActionMethod):
        return "it is a MotionMethod and an ActionMethod: it must be one of them"
    if getattr(found, "name", None) != name:
        return f"the class must have the name {name!r}, as its entry point has"
    for kind in ("size", "variant"):
        names = getattr(found, f"{kind}s", None)
        if not isinstance(names, Mapping):
            return f"{kind}s must be a dictionary by name"
        for one in names:
            try:
                check_label(kind, one)
            except InputError as error:
                return str(error)
    return ""
