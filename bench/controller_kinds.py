"""The kinds of tracking controllers, which differ in their training data."""

from dataclasses import dataclass

from bench.controller import FIRST_SEED

NO_CONTROLLER = "none"
"""In place of a controller's name where the expert or the method computes actions itself."""
ORIGINAL, UNCLIPPED, TUNED, ON_SUCCESSES = "original", "unclipped", "tuned", "tuned-on-successes"


@dataclass(frozen=True)
class ControllerKind:
    """The training data of the controllers of one kind."""

    name: str
    about: str
    """A description of the training data."""
    records_expert: bool = True
    """Whether they learn from new rollouts of the suite's expert. If not, they learn from the
    demonstrations that the methods learn from."""
    changed_physics: bool = False
    """Whether those rollouts are in the changed physics of the evaluation (appendix I)."""
    keeps_failures: bool = True
    """Whether failing rollouts are kept, except those that diverge."""
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
    """Returns the name of a controller in evaluations: its kind, and any seed after the first."""
    return kind if seed == FIRST_SEED else f"{kind}-{seed}"


RESEEDED = {seed: controller_name(ORIGINAL, seed) for seed in (2, 3, 4, 5)}
"""By seed, the names of controllers that differ from the original only in random numbers."""
AUDITED = (UNCLIPPED, ON_SUCCESSES, *RESEEDED.values())
"""The names of the controllers that only the experiment ``audit`` evaluates."""
ABOUT = {
    NO_CONTROLLER: "no controller: the expert and closed-loop methods act themselves",
    **{kind.name: kind.about for kind in KINDS.values()},
    **dict.fromkeys(RESEEDED.values(), "as original, with other random numbers"),
}
"""Descriptions of controllers, by name."""
