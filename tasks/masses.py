"""The variations of appendix I: which masses they change, and to what. Needs no simulator."""

from dataclasses import dataclass, replace

NOMINAL = "nominal"
VARIATIONS = ("heavy_object", "light_object", "light_hand", "heavy_hand")
PHYSICS = (NOMINAL, *VARIATIONS)


@dataclass(frozen=True)
class Change:
    """A new value of one attribute of some elements of the model."""

    element: str
    """``body`` or ``geom``."""
    names: tuple[str, ...]
    attribute: str
    """``mass`` of a body, which does not change its explicit inertia; or ``density`` of a geom."""
    value: float
    unit: str
    scale_inertia: bool = False
    """Whether the inertia of a body scales with its mass."""


def _mass(value: float, *bodies: str) -> Change:
    return Change("body", bodies, "mass", value, "kg")


def _pen_density(value: float) -> Change:
    return Change("geom", ("pen",), "density", value, "kg/m^3")


# The appendix's "palm" has mass 4.0, like the models' forearm (their palm weighs 0.3 kg). Its pen
# has "1.5", like the pen's density in g/cm^3 (the pen weighs 0.18 kg).
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
    """Other interpretations of the appendix's words.

    One changes the body named palm, by the same factor, instead of the forearm. The other also
    scales each body's inertia with its mass.
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
"""By task. The experiment `readings` measures how much the interpretation matters."""


def all_changes(task: str) -> dict[str, Change]:
    """Returns every change of a task's model by name, those of the appendix first."""
    return CHANGES[task] | READINGS[task]
