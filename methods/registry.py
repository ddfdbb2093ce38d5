"""Methods by name: those of this suite, and those of installed packages.

A package brings methods by entry points of the group ``bench.methods``; the entry point's name is
the method's, and its value the class.
"""

from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points

from methods.base import ActionMethod, Method, MotionMethod
from tasks.errors import InputError, unknown_name

ENTRY_POINTS = "bench.methods"
_CLASSES = {"kodex": "Kodex", "nn": "NN", "lstm": "LSTM", "ndp": "NDP", "ngf": "NGF"}
_VARIANTS = {("ngf", "published"): ("ngf_published", "PublishedNGF")}
"""Variants whose network is another one."""


def method_names() -> list[str]:
    """Returns the names of all methods there are, those of this suite first."""
    return list(_CLASSES) + sorted(_brought())


@cache
def get_method(name: str, variant: str = "described") -> type[Method]:
    """Returns the class of a method's variant, imported when it is first asked for.

    Raises:
        InputError: there is no such method, or its package does not bring one.
    """
    if (name, variant) in _VARIANTS:
        module, class_name = _VARIANTS[name, variant]
        found = getattr(import_module(f"methods.{module}"), class_name)
    elif name in _CLASSES:
        found = getattr(import_module(f"methods.{name}"), _CLASSES[name])
    elif name in _brought():
        found = _load(_brought()[name])
    else:
        raise unknown_name("method", name, method_names())
    return found


def _brought() -> dict[str, EntryPoint]:
    points = entry_points(group=ENTRY_POINTS)
    return {point.name: point for point in points if point.name not in _CLASSES}


def _load(point: EntryPoint) -> type[Method]:
    try:
        found = point.load()
    except Exception as error:
        raise InputError(f"method {point.name!r} ({point.value}) cannot be imported") from error
    kinds = (MotionMethod, ActionMethod)
    if not (isinstance(found, type) and issubclass(found, kinds)) or found.name != point.name:
        raise InputError(
            f"entry point {point.name!r} ({point.value}) must be a MotionMethod or an"
            f" ActionMethod whose name is {point.name!r}, got {found!r}"
        )
    return found
