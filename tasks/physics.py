"""Named changes of mass (appendix I), written into single simulations of a batch."""

from dataclasses import dataclass, replace
from functools import cache

import mujoco
import numpy as np
from mujoco.batch import MODEL_FIELDS, Batch

from tasks.base import Task
from tasks.data import FloatArray
from tasks.errors import unknown_name

NOMINAL = "nominal"
VARIATIONS = ("heavy_object", "light_object", "light_hand", "heavy_hand")
PHYSICS = (NOMINAL, *VARIATIONS)


@dataclass(frozen=True)
class Change:
    """One attribute of some elements of the model, set to a new value."""

    element: str
    """``body`` or ``geom``."""
    names: tuple[str, ...]
    attribute: str
    """``mass`` of a body, whose explicit inertia stays as it is, or ``density`` of a geom."""
    value: float
    unit: str
    scale_inertia: bool = False
    """Whether the inertia of a body grows with its mass, as that of more of the same stuff."""


def _mass(value: float, *bodies: str) -> Change:
    return Change("body", bodies, "mass", value, "kg")


def _pen_density(value: float) -> Change:
    return Change("geom", ("pen",), "density", value, "kg/m^3")


# The appendix's "palm" has mass 4.0, as the models' forearm does (their palm weighs 0.3 kg), and
# its pen has "1.5", as the pen's density in g/cm^3 does (the pen weighs 0.18 kg).
_KNUCKLES = ("ffknuckle", "mfknuckle", "rfknuckle", "lfknuckle")
CHANGES = {
    "tool": {
        "heavy_object": _mass(0.85, "Object"),
        "light_object": _mass(0.10, "Object"),
        "light_hand": _mass(1.0, "forearm"),
        "heavy_hand": _mass(8.0, "forearm"),
    },
    "door": {
        "heavy_object": _mass(12.54, "latch"),
        "light_object": _mass(0.54, "latch"),
        "light_hand": _mass(1.5, "forearm"),
        "heavy_hand": _mass(7.0, "forearm"),
    },
    "relocation": {
        "heavy_object": _mass(1.88, "Object"),
        "light_object": _mass(0.05, "Object"),
        "light_hand": _mass(3.0, "forearm"),
        "heavy_hand": _mass(5.0, "forearm"),
    },
    "reorientation": {
        "heavy_object": _pen_density(9500.0),
        "light_object": _pen_density(200.0),
        "light_hand": _mass(0.0001, *_KNUCKLES),
        "heavy_hand": _mass(0.20, *_KNUCKLES),
    },
}


def _readings(changes: dict[str, Change]) -> dict[str, Change]:
    """Other readings of the same words.

    The body that is named palm, by the same factor, in place of the one that weighs 4.0 kg; and
    each body's inertia grown with its mass.
    """
    found = {}
    for name, change in changes.items():
        if change.names == ("forearm",):
            palm = _mass(round(0.3 * change.value / 4.0, 6), "palm")
            found[name.replace("hand", "palm")] = palm
        if change.attribute == "mass":
            found[f"{name}_inertia"] = replace(change, scale_inertia=True)
    return found


READINGS = {task: _readings(changes) for task, changes in CHANGES.items()}
"""By task; the experiment `audit` shows what hangs on the reading."""


def physics_names(task: str) -> tuple[str, ...]:
    """Returns the names of all that `apply_physics` knows of a task."""
    return (NOMINAL, *CHANGES[task], *READINGS[task])


def apply_physics(task: Task, physics: str, batch: Batch) -> None:
    """Writes a variation into every simulation of a batch on the task's nominal model.

    Raises:
        InputError: there is no such variation.
    """
    for field, values in changed_fields(task, physics).items():
        rows = batch.expand(field)
        rows[:] = values[: rows.shape[1]]  # bvh_aabb: the bodies' volumes precede the meshes'


def changed_fields(task: Task, physics: str) -> dict[str, FloatArray]:
    """Returns the MjModel fields that a variation changes, with their new values.

    The changed model is compiled, so constants derived from the masses are those that MuJoCo
    itself derives.

    Raises:
        InputError: there is no such variation.
    """
    if physics not in physics_names(task.name):
        raise unknown_name("physics variation", physics, physics_names(task.name))
    changes = CHANGES[task.name] | READINGS[task.name]
    return {} if physics == NOMINAL else _changed_fields(task, changes[physics])


@cache
def _changed_fields(task: Task, change: Change) -> dict[str, FloatArray]:
    spec = task.specification()
    for name in change.names:
        element = getattr(spec, change.element)(name)
        if change.scale_inertia:
            element.inertia = element.inertia * (change.value / element.mass)
        setattr(element, change.attribute, change.value)
    changed: mujoco.MjModel = spec.compile()
    fields = sorted(field for field in MODEL_FIELDS if not field.startswith("opt."))
    pairs = {field: (getattr(task.model, field), getattr(changed, field)) for field in fields}
    return {field: new for field, (old, new) in pairs.items() if not np.array_equal(old, new)}
