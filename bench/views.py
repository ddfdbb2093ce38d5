"""Views of single episodes, which packages provide as entry points of ``bench.views``."""

from collections.abc import Callable
from typing import Any

from tasks.errors import InputError, described
from tasks.packages import entry_points_of, owners

ENTRY_POINTS = "bench.views"


def view(name: str) -> Callable[..., Any]:
    """Returns the function of the entry point of that name.

    Raises:
        InputError: no installed package provides it, several do, or it cannot be imported.
    """
    points = [point for point in entry_points_of(ENTRY_POINTS) if point.name == name]
    if not points:
        raise InputError(
            f"no installed package provides the view {name!r}: kodex-bench does, so reinstall it"
        )
    packages = owners(points)
    if len(points) > 1:
        raise InputError(f"{packages} provide the same view {name!r}: uninstall all but one")
    try:
        found: Callable[..., Any] = points[0].load()
    except Exception as error:
        raise InputError(
            f"view {name!r} of {packages} cannot be imported: {described(error)}; repair or"
            f" uninstall {packages}"
        ) from error
    return found
