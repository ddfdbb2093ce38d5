"""The kinds of tracking controllers, told apart by what they learn from."""

from dataclasses import dataclass

from bench.controller import FIRST_SEED

NO_CONTROLLER = "none"
"""In place of a controller's name where the expert or the method computes actions itself."""
ORIGINAL, UNCLIPPED, TUNED, ON_SUCCESSES = "original", "unclipped", "tuned", "tuned-on-successes"


@dataclass(frozen=True)
class ControllerKind:
    """What the controllers of one kind learn from."""

    name: str
    about: str
    """What they learn from, in words."""
    records_expert: bool = True
    """Whether they learn from new rollouts of the suite's expert. If not, they learn from the
    demonstrations that the methods learn from."""
    changed_physics: bool = False
    """Whether those rollouts are in the changed physics of the evaluation (appendix I)."""
    keeps_failures: bool = True
    """Whether failing rollouts are kept, but for those that diverge."""
    clips_actions: bool = True
    """Whether the expert's actions are clipped to [-1, 1], as the simulator clips them."""


KINDS = {
    kind.name: kind
    for kind in (
        ControllerKind(
            ORIGINAL,
            "trained on the demonstrations, in nominal physics",
            records_expert=False,
            keeps_failures=False,
        ),
        ControllerKind(
            UNCLIPPED,
            "as original, but on the expert's actions before they are clipped",
            clips_actions=False,
        ),
        ControllerKind(
            TUNED,
            "trained on the expert's episodes in the changed physics",
            changed_physics=True,
        ),
        ControllerKind(
            ON_SUCCESSES,
            "as tuned, but on successful episodes only",
            changed_physics=True,
            keeps_failures=False,
        ),
    )
}
"""Every kind, by name."""


def controller_name(kind: str, seed: int = FIRST_SEED) -> str:
    """Returns what evaluations call a controller: its kind, and its seed after the first seed."""
    return kind if seed == FIRST_SEED else f"{kind}-{seed}"


RESEEDED = {seed: controller_name(ORIGINAL, seed) for seed in (2, 3, 4, 5)}
"""By seed, the names of controllers that differ from the original in their random numbers alone."""
AUDITED = (UNCLIPPED, ON_SUCCESSES, *RESEEDED.values())
"""The names of the controllers that the experiment ``audit`` alone evaluates."""
ABOUT = {
    NO_CONTROLLER: "no controller: the expert and closed-loop methods act themselves",
    **{kind.name: kind.about for kind in KINDS.values()},
    **dict.fromkeys(RESEEDED.values(), "as original, with other random numbers"),
}
"""By name, what turns a predicted motion into actions, in words."""
