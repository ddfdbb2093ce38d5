"""Writes variations of mass (appendix I) into the simulations of a batch."""

from functools import cache

import mujoco
import numpy as np
from mujoco.batch import MODEL_FIELDS, Batch

from tasks.base import Task
from tasks.data import FloatArray
from tasks.errors import unknown_name
from tasks.masses import NOMINAL, Change


def apply_physics(task: Task, physics: str, batch: Batch) -> None:
    """Writes a variation into every simulation of a batch of the task's nominal model.

    Raises:
        InputError: there is no such variation.
    """
    for field, values in changed_fields(task, physics).items():
        rows = batch.expand(field)
        rows[:] = values[: rows.shape[1]]  # bvh_aabb: the bodies' volumes precede the meshes'


def changed_fields(task: Task, physics: str) -> dict[str, FloatArray]:
    """Returns the MjModel fields that a variation changes, with their new values.

    The changed model is compiled, so that MuJoCo derives all constants from the new masses.

    Raises:
        InputError: there is no such variation.
    """
    if physics not in task.physics:
        raise unknown_name("physics variation", physics, task.physics)
    return {} if physics == NOMINAL else _changed_fields(task, task.changes[physics])


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
