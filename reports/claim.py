"""What a claim of the paper is: a sentence, and the statements into which it is cut.

Each statement is about one number, and says that it exceeds a margin.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from bench.controller_kinds import NO_CONTROLLER, ORIGINAL, TUNED
from bench.labels import EXPERT
from methods.registry import PAPER
from reports.style import display

SIMILAR = 5.0
"""Points of success within which two methods are called comparable, or about the same."""
FEW = 2
"""The fewest conditions that are called a few."""
LEARNERS = PAPER
BASELINES = PAPER[1:]


@dataclass(frozen=True)
class Setting:
    """The conditions of a success rate."""

    method: str
    task: str
    split: str = "test"
    physics: str = "nominal"
    tuned: bool = False
    variant: str = "described"

    def __str__(self) -> str:
        parts = [display(self.method), display(self.task)]
        parts += [display(self.split)] if self.split != "test" else []
        parts += [display(self.physics)] if self.physics != "nominal" else []
        parts += ["tuned"] if self.tuned else []
        parts += [display(self.variant)] if self.variant != "described" else []
        return " ".join(parts)

    @property
    def controller(self) -> str:
        """The name of its controller in results."""
        if self.method == EXPERT:
            return NO_CONTROLLER
        return TUNED if self.tuned else ORIGINAL


@dataclass(frozen=True)
class _InPoints:
    """A statement about points of success."""

    unit: ClassVar[str] = " points"
    form: ClassVar[str] = "+.1f"
    """Format of the number."""


@dataclass(frozen=True)
class Contrast(_InPoints):
    """States that the success of left minus that of right exceeds the margin."""

    left: Setting
    right: Setting
    margin: float = 0.0

    def __str__(self) -> str:
        return f"{self.left} minus {self.right}"


@dataclass(frozen=True)
class Overall(_InPoints):
    """States that left minus right, averaged over conditions, exceeds the margin."""

    pairs: tuple[tuple[Setting, Setting], ...]
    """Left and right in each condition; all left ones are of one method, and all right ones."""
    margin: float = 0.0

    def __str__(self) -> str:
        left, right = self.pairs[0]
        names = f"{display(left.method)} minus {display(right.method)}"
        return f"{names}, mean of {len(self.pairs)} conditions"


@dataclass(frozen=True)
class AtLeast(_InPoints):
    """States that so many of the contrasts hold, or more: that the COUNT-th largest does."""

    count: int
    contrasts: tuple[Contrast, ...]
    """All of the same margin."""

    @property
    def margin(self) -> float:
        """The margin of each contrast."""
        return self.contrasts[0].margin

    def __str__(self) -> str:
        place = ("largest", "second largest")[self.count - 1]
        return f"the {place} of {len(self.contrasts)} differences"


@dataclass(frozen=True)
class SizeMatters(_InPoints):
    """States that a method's best size succeeds more often than its worst, averaged over tasks."""

    method: str
    margin: float = SIMILAR

    def __str__(self) -> str:
        return f"{display(self.method)}, best size minus worst size, mean over tasks"


@dataclass(frozen=True)
class SeedMatters(_InPoints):
    """States that success varies more over seeds than KODex's, averaged over tasks.

    What varies is the standard deviation over seeds.
    """

    method: str
    margin: float = 0.0

    def __str__(self) -> str:
        return f"spread of {display(self.method)} minus that of KODex, mean over tasks"


@dataclass(frozen=True)
class Trend:
    """States that a quantity of KODex rises with the set of observables, or falls."""

    quantity: str
    """SUCCESS, ERROR or TIME."""
    rises: bool
    margin: float = 0.0
    unit: ClassVar[str] = ""
    form: ClassVar[str] = ".2f"

    def __str__(self) -> str:
        way = "rises" if self.rises else "falls"
        return f"rank correlation, {self.quantity} {way} with the observables"


SUCCESS, ERROR, TIME = "success", "imitation error", "fit time"


@dataclass(frozen=True)
class MostBelowOne:
    """States that over half of the eigenvalue magnitudes of K are below one on a task."""

    task: str
    margin: float = 50.0
    unit: ClassVar[str] = "%"
    form: ClassVar[str] = ".1f"

    def __str__(self) -> str:
        return f"share of magnitudes below one on {display(self.task)}"


@dataclass(frozen=True)
class LargestAboveOne:
    """States that the largest eigenvalue magnitude of K exceeds one on a task."""

    task: str
    margin: float = 1.0
    unit: ClassVar[str] = ""
    form: ClassVar[str] = ".5f"

    def __str__(self) -> str:
        return f"largest magnitude on {display(self.task)}"


@dataclass(frozen=True)
class TrainsLonger:
    """States that a method trains more than so many times as long as KODex on a task."""

    method: str
    task: str
    margin: float
    unit: ClassVar[str] = " times as long as KODex"
    form: ClassVar[str] = ".1f"

    def __str__(self) -> str:
        return f"{display(self.method)} {display(self.task)}"


Statement = (
    Contrast
    | Overall
    | AtLeast
    | SizeMatters
    | SeedMatters
    | Trend
    | MostBelowOne
    | LargestAboveOne
    | TrainsLonger
)


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper. It holds if all its statements do."""

    name: str
    says: str
    source: str
    statements: Sequence[Statement]
    relevant: float = SIMILAR
    """The smallest difference that matters, in the unit of the statements."""
    unprinted: str = "published as a figure only"
    """The answer of the paper's tables if they have none of the numbers."""


def about_the_same(left: Setting, right: Setting) -> tuple[Contrast, Contrast]:
    """Returns the two contrasts that together state a difference of under SIMILAR points."""
    return Contrast(left, right, -SIMILAR), Contrast(right, left, -SIMILAR)
