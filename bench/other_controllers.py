"""Refuses to replace evaluations whose controller was trained with other settings."""

import json
from collections.abc import Iterable
from dataclasses import asdict

from bench.results import Results
from bench.spec import Cell, ControllerSpec
from tasks.errors import InputError

SETTINGS = ("demos", "config")
"""Fields of a controller that are compared."""


def check_controllers(results: Results, cells: Iterable[Cell]) -> None:
    """Checks that stored evaluations of cells used controllers trained with the same settings.

    Controllers that differ otherwise, as in their version, pass: their evaluations are set aside
    when new ones are stored.

    Raises:
        InputError: stored evaluations used a controller of the same name with other settings.
    """
    stored = {one.place: one for one in results.manifest().wanted}
    for cell in cells:
        there = stored.get(cell.wanted.place)
        if not (there and there.controller and cell.controller):
            continue
        same_fit = there.fit.key == cell.fit.key
        same_controller = there.controller.key == cell.controller.key
        if not same_fit or same_controller or not results.has_controller(there.controller):
            continue
        differ = _differences(results, there.controller.key, cell.controller)
        if differ and results.stored_episodes(there):
            raise InputError(
                f"{results.folder} holds {cell.evaluation.name} of {cell.fit.label}"
                f" with another controller ({', '.join(differ)}): choose another folder"
            )


def _differences(results: Results, key: str, asked: ControllerSpec) -> list[str]:
    """The settings in which the stored controller of a key differs from the requested one."""
    stored, wanted = results.controller_spec(key), json.loads(json.dumps(asdict(asked)))
    return [
        f"its {name} {stored.get(name)}, requested {wanted[name]}"
        for name in SETTINGS
        if stored.get(name) != wanted[name]
    ]
