"""Presets: named studies, which say what a run computes and with how many episodes."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from bench.controller import ControllerConfig
from methods.registry import PAPER, SUITE, TO_BEAT
from methods.saved import Saved
from tasks.errors import unknown_name
from tasks.registry import FIRST, TASKS


@dataclass(frozen=True)
class Study:
    """The settings of a run. `bench.experiments` turns them into cells."""

    episodes: Mapping[str, int]
    """By experiment, the episodes of each evaluation. Only the experiments named here run."""
    tasks: tuple[str, ...] = TASKS
    methods: tuple[str, ...] = (*PAPER, *TO_BEAT)
    expert: bool = True
    """Whether the expert is evaluated too."""
    sizes: tuple[str, ...] | None = None
    """Sizes that the experiment ``sizes`` compares; ``smallest`` is the first size of each method.
    A method that has none of these sizes is compared at all its sizes. Default: all."""
    variants: tuple[str, ...] | None = None
    """Variants that the experiment ``variants`` compares. Default: all."""
    seeds: tuple[int, ...] = tuple(range(1, 11))
    """Each repeats the whole study: see docs/protocol.md."""
    demos: int = 200
    demos_keys: Mapping[str, str] = field(default_factory=dict)
    """By task, the key of the demonstrations to learn from. Default: the expert's."""
    taught_by: str = FIRST
    """Which of a task's experts demonstrates."""
    epochs_share: float = 1.0
    """The share of its epochs that a method trains for, if its config has such a field."""
    settings: Mapping[tuple[str, str], Any] = field(default_factory=dict)
    """By method and field of its config, values that replace the config's own."""
    weights: Mapping[tuple[str, str], Saved] = field(default_factory=dict)
    """By method and task, weights that are evaluated; the method is then not trained."""
    controller: ControllerConfig = field(default_factory=ControllerConfig)
    note: str = ""
    """A note for readers of the tables."""

    def without(self, methods: Collection[str]) -> "Study":
        """Returns the study without these methods and all that it says of them."""
        return replace(
            self,
            methods=tuple(name for name in self.methods if name not in methods),
            settings={k: v for k, v in self.settings.items() if k[0] not in methods},
            weights={k: v for k, v in self.weights.items() if k[0] not in methods},
        )


def get_preset(name: str) -> Study:
    """Returns the study of that name.

    Raises:
        InputError: there is no such preset.
    """
    if name not in PRESETS:
        raise unknown_name("preset", name, PRESETS)
    return PRESETS[name]


def experiment_names() -> list[str]:
    """Returns the names of all experiments."""
    in_order = ("paper", "beyond", "audit")
    return list(dict.fromkeys(name for study in in_order for name in PRESETS[study].episodes))


SMALLEST = "smallest"
REDUCED = "Two seeds and fewer episodes than the paper's protocol; trained in full."
FOR_TESTS = (
    "The preset smoke is for tests: with its few demonstrations and training epochs nothing is"
    " learnt, and its numbers mean nothing."
)

PRESETS = {
    "smoke": Study(
        episodes={name: 20 for name in ("sizes", "success", "ood", "stability")},
        tasks=("door",),
        sizes=(SMALLEST,),
        seeds=(1,),
        demos=10,
        epochs_share=0.025,
        controller=ControllerConfig(epochs=5),
        note=FOR_TESTS,
    ),
    "quick": Study(
        episodes={"success": 200, "ood": 100, "lifting": 50, "stability": 50},
        seeds=(1, 2),
        note=REDUCED,
    ),
    "paper": Study(
        episodes={
            "sizes": 50,
            "success": 1000,
            "ood": 1000,
            "robustness": 200,
            "lifting": 1000,
            "stability": 50,
            "efficiency": 200,
        }
    ),
    "audit": Study(
        episodes={
            "robustness": 200,
            "variants": 200,
            "rules": 200,
            "readings": 200,
            "controllers": 200,
        },
        methods=PAPER,
        seeds=(1, 2, 3),
    ),
    "beyond": Study(
        episodes={
            "success": 200,
            "ood": 200,
            "robustness": 200,
            "disturbed": 200,
            "closed_loop": 200,
        },
        methods=SUITE,
        seeds=tuple(range(1, 6)),
    ),
}
