"""What may go wrong in an episode, beyond changed physics, and how strongly.

A disturbance is named by its kind and its strength, ``joints_off_0.05``; several by a plus sign
between them, ``joints_off_0.05+late_1``. What it draws depends on the seed, the split, the start
and the disturbance alone, so that all methods of a seed meet the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tasks.errors import InputError, unknown_name

if TYPE_CHECKING:
    from tasks.base import Task

VERSION = 2
"""To be raised when a change of the code changes what a disturbance does."""
UNDISTURBED = "none"
"""The name of no disturbance."""


@dataclass(frozen=True)
class Kind:
    """A kind of disturbance."""

    unit: str
    strengths: tuple[float, ...]
    """Those that the experiment ``disturbed`` tries."""
    summary: str


KINDS = {
    "joints_off": Kind(
        "rad",
        (0.02, 0.05, 0.15),
        "each hinge of the hand starts off by a normal error, within its limits",
    ),
    "object_off": Kind(
        "m",
        (0.01, 0.02),
        "the object starts elsewhere by a normal error in the horizontal plane",
    ),
    "hand_push": Kind(
        "rad/s", (1.0, 4.0), "once, each hinge of the hand gets a normal change of velocity"
    ),
    "object_push": Kind(
        "m/s",
        (0.1, 0.4),
        "once, the object gets a normal change of velocity in the horizontal plane",
    ),
    "noise": Kind(
        "own unit",
        (0.01, 0.03),
        "what the policy and the controller read has a normal error; the expert, which reads other"
        " quantities, has errors of its own",
    ),
    "late": Kind("control steps", (1, 2), "actions arrive so many control steps late"),
}
"""Normal errors are independent, with the strength as their standard deviation. A push comes at a
random step of the first half of an episode."""
TOGETHER = "joints_off_0.05+late_1"
"""The disturbances that the experiment ``disturbed`` tries together."""
REPLANNED = (*TOGETHER.split("+"), TOGETHER)
"""Those in which the experiment ``closed_loop`` predicts anew."""


@dataclass(frozen=True)
class Disturbance:
    """A kind of disturbance with its strength."""

    kind: str
    strength: float

    @property
    def name(self) -> str:
        """Its name, as in ``joints_off_0.05``."""
        return f"{self.kind}_{self.strength:g}"


def find_disturbances(name: str, task: Task) -> tuple[Disturbance, ...]:
    """Returns the disturbances of that name, none for `UNDISTURBED`.

    Raises:
        InputError: there is no such kind, the strength is not a number above 0, a kind occurs
            twice, kinds are not in the order of `KINDS`, or no object of the task can be disturbed.
    """
    if name == UNDISTURBED:
        return ()
    found = tuple(_parsed(part, name) for part in name.split("+"))
    kinds = [one.kind for one in found]
    if len(set(kinds)) < len(kinds):
        raise InputError(f"disturbance {name!r} names a kind twice")
    if kinds != (in_order := [kind for kind in KINDS if kind in kinds]):
        whole = "+".join(found[kinds.index(kind)].name for kind in in_order)
        raise InputError(f"disturbance {name!r} is written {whole!r}")
    for kind in kinds:
        if not _possible(kind, task):
            raise InputError(
                f"{kind}: the object of {task.name} is not free to move, or its state does not tell"
                " where it is"
            )
    return found


def meaning_of(name: str) -> str:
    """Returns what a disturbance of that name, other than `UNDISTURBED`, means."""
    kinds = [KINDS[part.rpartition("_")[0]] for part in name.split("+")]
    return "; ".join(f"{kind.summary} [{kind.unit}]" for kind in kinds)


def _parsed(part: str, name: str) -> Disturbance:
    kind, _, number = part.rpartition("_")
    if part in KINDS:
        example = Disturbance(part, KINDS[part].strengths[0]).name
        raise InputError(
            f"disturbance {name!r}: {part} needs a strength [{KINDS[part].unit}], as in {example!r}"
        )
    if kind not in KINDS:
        raise unknown_name("kind of disturbance", kind or part, KINDS)
    try:
        strength = float(number)
    except ValueError:
        strength = float("nan")
    whole = kind != "late" or strength.is_integer()
    if not (0 < strength < float("inf") and whole):
        allowed = "a whole number" if kind == "late" else "a number"
        raise InputError(
            f"disturbance {name!r}: the strength of {kind} must be {allowed} above 0"
            f" [{KINDS[kind].unit}], got {number!r}"
        )
    found = Disturbance(kind, strength)
    if found.name != part:
        raise InputError(f"disturbance {part!r} is written {found.name!r}")
    return found


def names_of(task: Task) -> list[str]:
    """Returns the names of the disturbances that the experiment ``disturbed`` tries on a task."""
    return [name for name in all_names() if _possible(name, task)]


def all_names() -> list[str]:
    """Returns the names of the disturbances that the experiment ``disturbed`` tries on any task."""
    alone = [Disturbance(kind, s).name for kind, about in KINDS.items() for s in about.strengths]
    return [*alone, TOGETHER]


def _possible(kind: str, task: Task) -> bool:
    return bool(task.object_slides) or not kind.startswith("object")
