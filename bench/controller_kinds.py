"""The kinds of tracking controllers, which differ in what they learn from and start from."""

from dataclasses import dataclass

NO_CONTROLLER = "none"
"""In place of a controller's name where the expert or the method computes actions itself."""
ORIGINAL, UNCLIPPED, TUNED, ON_SUCCESSES = "original", "unclipped", "tuned", "tuned-on-successes"
FINE_TUNED = "fine-tuned"


@dataclass(frozen=True)
class ControllerKind:
    """What the controllers of one kind learn from and start from."""

    name: str
    about: str
    """A description."""
    records_expert: bool = True
    """Whether they learn from new rollouts of the suite's expert. If not, they learn from the
    demonstrations that the methods learn from."""
    changed_physics: bool = False
    """Whether those rollouts are in the changed physics of the evaluation (appendix I)."""
    keeps_failures: bool = True
    """Whether failing rollouts are kept, except those that diverge."""
    clips_actions: bool = True
    """Whether the expert's actions are clipped to [-1, 1], as the simulator clips them."""
    starts_from: str = ""
    """The kind whose weights, of the same seed, training starts from. Default: random weights."""


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
            "trained on the expert's successful episodes in the changed physics",
            changed_physics=True,
            keeps_failures=False,
        ),
        ControllerKind(
            FINE_TUNED,
            "trained on the expert's episodes in the changed physics, from the weights of the"
            " original controller",
            changed_physics=True,
            starts_from=ORIGINAL,
        ),
    )
}
"""Every kind, by name."""


COMPARED = (NO_CONTROLLER, ORIGINAL)
"""The kinds of the main comparison."""
AUDITED = (UNCLIPPED, ON_SUCCESSES, FINE_TUNED)
"""The kinds of controllers that only the experiment ``controllers`` evaluates."""
ABOUT = {
    NO_CONTROLLER: "no controller: the expert and closed-loop methods act themselves",
    **{kind.name: kind.about for kind in KINDS.values()},
}
"""Descriptions of controllers, by kind."""
