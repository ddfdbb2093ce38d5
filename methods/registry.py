"""Methods by name: those of this suite and those of installed packages.

A package registers a method as an entry point of the group ``bench.methods``: its name is the
method's, and its value the class.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib import import_module

from methods.base import ActionMethod, Method, MotionMethod
from methods.names import check_label
from tasks.errors import InputError
from tasks.packages import Group

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
ENTRY_POINTS = "bench.methods"
_BROUGHT = Group(ENTRY_POINTS, "method", SUITE)

_INTRODUCED: dict[str, type[Method]] = {}
"""Stand-ins by name, for methods that this process must not import."""


def method_names() -> list[str]:
    """Returns the names of all methods, those of this suite first."""
    return [*_CLASSES, *package_methods()]


def package_methods() -> list[str]:
    """Returns the names of the methods in packages, except `unusable` ones."""
    return _BROUGHT.usable()


def unusable() -> dict[str, str]:
    """Returns the unusable methods of packages by name, with the reason. Imports nothing.

    It includes a name of the suite if a package has a method of that name. The suite's is used.
    """
    return _BROUGHT.unusable()


def unknown_method(name: str) -> InputError:
    """Returns the error for a name not in `method_names`, with the reason if it is unusable."""
    return _BROUGHT.unknown(name, method_names())


@cache
def get_method(name: str, variant: str = "described") -> type[Method]:
    """Returns the class of a method's variant. It is imported when it is first used.

    Raises:
        PackageError: the method of a package cannot be used.
        InputError: there is no such method.
    """
    if name in _INTRODUCED:
        return _INTRODUCED[name]
    if name not in method_names():
        raise unknown_method(name)
    if name in _CLASSES:
        return variant_class(_imported(name, _CLASSES[name]), variant)
    from methods.guard import guarded  # imports torch, which `bench list` does not need

    return _BROUGHT.load(name, class_fault, guarded("import", name))


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
