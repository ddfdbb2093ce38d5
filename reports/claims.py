"""The claims of the paper: its sentences, each as contrasts that numbers can decide.

They were written down before this suite had results. `reports.verdicts` judges them.
"""

from dataclasses import dataclass
from itertools import combinations

from bench.controller_kinds import NO_CONTROLLER, ORIGINAL, TUNED
from bench.labels import EXPERT
from reports.style import METHODS, TASKS, display
from tasks.masses import VARIATIONS

SIMILAR = 5.0
"""Points of success within which two methods are called comparable, or about the same."""
BASELINES = METHODS[2:]
LEARNERS = METHODS[1:]


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
        parts += [self.split] if self.split != "test" else []
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
class Contrast:
    """States that left minus right exceeds the margin, in points of success."""

    left: Setting
    right: Setting
    margin: float = 0.0


@dataclass(frozen=True)
class Claim:
    """A sentence about success. It holds if all its contrasts do."""

    name: str
    says: str
    source: str
    contrasts: tuple[Contrast, ...]


@dataclass(frozen=True)
class OtherClaim:
    """A sentence about other numbers than success."""

    name: str
    says: str
    source: str
    paper: str
    """Whether it holds in the paper's own numbers."""


def _about_the_same(left: Setting, right: Setting) -> tuple[Contrast, Contrast]:
    return Contrast(left, right, -SIMILAR), Contrast(right, left, -SIMILAR)


def _varied(method: str, task: str, physics: str, tuned: bool = False) -> Setting:
    return Setting(method, task, physics=physics, tuned=tuned and method != EXPERT)


OTHER_TASKS = TASKS[1:]
CLAIMS = (
    Claim(
        "kodex-ood-tool",
        "Out of distribution, KODex outperforms the four baselines on Tool.",
        "appendix H",
        tuple(
            Contrast(Setting("kodex", "tool", "ood"), Setting(m, "tool", "ood")) for m in BASELINES
        ),
    ),
    Claim(
        "ngf-ood",
        "Out of distribution, NGF performs best of the methods on the other tasks.",
        "appendix H",
        tuple(
            Contrast(Setting("ngf", task, "ood"), Setting(m, task, "ood"))
            for task in OTHER_TASKS
            for m in LEARNERS
            if m != "ngf"
        ),
    ),
    Claim(
        "kodex-ood-comparable",
        "Out of distribution, KODex is comparable to NDP and LSTM on the other tasks"
        f" (within {SIMILAR:g} points).",
        "appendix H",
        tuple(
            contrast
            for task in OTHER_TASKS
            for m in ("ndp", "lstm")
            for contrast in _about_the_same(Setting("kodex", task, "ood"), Setting(m, task, "ood"))
        ),
    ),
    Claim(
        "light-hand-costs-least",
        "With the original controller, no variation leaves a method more success than Light Hand"
        f" (by {SIMILAR:g} points or more).",
        "appendix I",
        tuple(
            Contrast(_varied(m, task, "light_hand"), _varied(m, task, other), -SIMILAR)
            for task in TASKS
            for m in LEARNERS
            for other in VARIATIONS
            if other != "light_hand"
        ),
    ),
    Claim(
        "light-hand-no-gain",
        f"In Light Hand, the tuned controller adds no considerable success (under {SIMILAR:g}"
        " points).",
        "appendix I",
        tuple(
            Contrast(_varied(m, task, "light_hand"), _varied(m, task, "light_hand", True), -SIMILAR)
            for task in TASKS
            for m in LEARNERS
        ),
    ),
    Claim(
        "heavy-hand-gain",
        "In Heavy Hand, every method benefits from the tuned controller.",
        "appendix I",
        tuple(
            Contrast(_varied(m, task, "heavy_hand", True), _varied(m, task, "heavy_hand"))
            for task in TASKS
            for m in LEARNERS
        ),
    ),
    Claim(
        "kodex-robust",
        "In changed physics, KODex outperforms NN, LSTM and NDP.",
        "appendix I",
        tuple(
            Contrast(_varied("kodex", task, v, tuned), _varied(m, task, v, tuned))
            for task in TASKS
            for v in VARIATIONS
            for tuned in (False, True)
            for m in ("nn", "lstm", "ndp")
        ),
    ),
    Claim(
        "kodex-above-expert-relocation",
        "In Heavy Object on Relocation, KODex with the original controller outperforms the expert.",
        "appendix I",
        (
            Contrast(
                _varied("kodex", "relocation", "heavy_object"),
                _varied("expert", "relocation", "heavy_object"),
            ),
        ),
    ),
    Claim(
        "kodex-above-expert-door",
        "In Heavy Object on Door, KODex with the original controller outperforms the expert.",
        "appendix I",
        (
            Contrast(
                _varied("kodex", "door", "heavy_object"), _varied("expert", "door", "heavy_object")
            ),
        ),
    ),
    Claim(
        "sets-alike",
        f"The second, third and fourth set of observables succeed about as often (within"
        f" {SIMILAR:g} points).",
        "appendix J",
        tuple(
            contrast
            for task in TASKS
            for one, other in combinations(("set_2", "described", "set_4"), 2)
            for contrast in _about_the_same(
                Setting("kodex", task, variant=one), Setting("kodex", task, variant=other)
            )
        ),
    ),
    Claim(
        "set-2-relocation",
        "On Relocation, KODex does marginally better with set 2 than with set 3.",
        "appendix J",
        (
            Contrast(
                Setting("kodex", "relocation", variant="set_2"), Setting("kodex", "relocation")
            ),
        ),
    ),
)
OTHER_CLAIMS = (
    OtherClaim(
        "magnitudes-below-one",
        "Most eigenvalue magnitudes of K are below one, and a few are above.",
        "appendix J",
        "holds (Table 12; Fig. 7 is a picture)",
    ),
    OtherClaim(
        "error-falls",
        "The more observables, the smaller the imitation error.",
        "appendix J",
        "published as a figure only",
    ),
    OtherClaim(
        "time-grows",
        "The more observables, the longer the fit.",
        "appendix J",
        "published as a figure only",
    ),
    OtherClaim(
        "trains-faster",
        "KODex takes about a tenth of the training time of each baseline (at most a third).",
        "abstract",
        "no numbers in the appendix",
    ),
)
