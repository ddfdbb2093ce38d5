"""Measures how well an expert's demonstrations can be imitated, before the expert is shipped.

There are two probes. (a) The controller, trained on the training demonstrations, tracks the
recorded motions of the validation demonstrations. Its success is what a perfect method could reach.
(b) KODex, fitted to the training demonstrations, runs from the starts of ``probe``. Its success is
a minimum to pass, and does not rank experts.
"""

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from safetensors.numpy import load

from bench.controller import Controller, ControllerConfig, train_controllers
from bench.doing import say
from bench.rollout import TrackedMotion
from methods.base import MotionMethod, Parameters
from methods.kodex import Kodex
from tasks.base import Task
from tasks.data import Demos, FloatArray, Layout
from tasks.demos import TRAINING, VALIDATION, split
from tasks.experts import Expert
from tasks.files import whole_file
from tasks.recorder import TooFewError, make_demos
from tasks.simulator import Policy, rollout
from tasks.words import count_of

PROBED, PROBED_SEEDS = 1000, range(1, 6)
"""Starts of ``probe``, and seeds, by which an expert is judged."""
EXPERT_FLOOR, TRACKED_FLOOR = 0.95, 0.97
KODEX_FLOORS = {"tool": 0.97, "door": 0.93, "relocation": 0.85, "reorientation": 0.59}
"""Table 1, less three points."""


class Recorded(MotionMethod):
    """Predicts the recorded demonstration that began at the start."""

    name = "recorded"

    def __init__(self, demos: Demos) -> None:
        robot_dim, (*_, state_dim) = demos.velocities.shape[-1], demos.states.shape
        layout = Layout(robot_dim, state_dim - robot_dim, demos.actions.shape[-1])
        super().__init__(None, layout)
        self._states = demos.states

    def rollout(self, start: FloatArray, steps: int) -> FloatArray:
        """Returns the recorded states (B, steps + 1, D) of the nearest start."""
        apart = np.abs(start[:, None] - self._states[:, 0]).max(axis=-1)
        return self._states[apart.argmin(axis=1), : steps + 1]

    def fit(self, demos: Demos, validation: Demos, seed: int) -> None:
        """Does nothing: there is nothing to learn."""

    def parameters(self) -> Parameters:
        """Returns no parameters: nothing is learnt."""
        return {}

    def load(self, parameters: Parameters) -> None:
        """Does nothing: there are no parameters."""


def probe(
    task: Task, expert: Policy, episodes: int, config: ControllerConfig, seeds: Sequence[int]
) -> dict[str, Any]:
    """Returns the success of both probes of an expert, and how rough its demonstrations are.

    Each seed has demonstrations, a controller and a KODex of its own. ``of_seed`` has a row for
    each, and the other values are means over them.

    Args:
        task: the task.
        expert: the policy that demonstrates.
        episodes: number of starts of ``probe`` for (b), the same for each seed.
        config: training settings of the controllers.
        seeds: of the starts of ``demo`` and of the controllers.
    """
    say(f"recording demonstrations of {task.name}")
    demos = [make_demos(task, expert, TRAINING + VALIDATION, seed) for seed in seeds]
    say("training controllers")
    training = [split(of_seed)[0] for of_seed in demos]
    weights = train_controllers(config, training, task.name, seeds)
    rows = []
    for seed, of_seed, learnt in zip(seeds, demos, weights, strict=True):
        say(f"evaluating controller and KODex of seed {seed} in {count_of(episodes, 'episode')}")
        rows.append({"seed": seed} | _imitated(task, of_seed, Controller(learnt), seed, episodes))
    means = pd.DataFrame(rows).drop(columns="seed").mean().round(6).to_dict()
    return {"episodes": episodes, **means, "of_seed": rows}


def _imitated(
    task: Task, demos: Demos, controller: Controller, seed: int, episodes: int
) -> dict[str, float]:
    training, validation = split(demos)
    kodex = Kodex(Kodex.sizes["single"], task.layout)
    kodex.fit(training, validation, seed)
    tracked = rollout(task, validation.starts, TrackedMotion(Recorded(validation), controller))
    starts = task.sample("probe", episodes)
    imitated = rollout(task, starts, TrackedMotion(kodex, controller))
    eigenvalues = kodex.diagnostics()["eigenvalues"]
    return {
        "tracked": float(tracked.success.mean()),
        "kodex": float(imitated.success.mean()),
        "largest_eigenvalue": float(np.hypot(*eigenvalues.T).max()),
        "starts_tried": int(demos.starts.index[-1]) + 1,
        "squared_action_change": float((np.diff(demos.actions, axis=1) ** 2).mean()),
        "squared_hand_velocity": float((demos.velocities**2).mean()),
    }


def complete_card(task: Task, path: Path) -> list[str]:
    """Adds ``imitation`` and ``faults`` to the card of a trained expert; returns the faults.

    An expert that succeeds too rarely to demonstrate has no ``imitation``. The weights lie beside
    the card. See `probe` and `faults`.
    """
    card = json.loads(path.read_text())
    expert = Expert(load(path.with_suffix(".safetensors").read_bytes()))
    with suppress(TooFewError):
        card["imitation"] = probe(task, expert, PROBED, ControllerConfig(), PROBED_SEEDS)
    card["faults"] = faults(card)
    with whole_file(path) as file:
        file.write_text(json.dumps(card, indent=2) + "\n")
    return list(card["faults"])


def faults(card: Mapping[str, Any]) -> list[str]:
    """Returns why an expert must not be shipped, given its card.

    Without ``imitation``, see `probe`, none of its motions count as tracked. The rule is in
    docs/protocol.md.
    """
    imitation = card.get("imitation", {"tracked": 0.0, "kodex": 0.0})
    succeeded = card["success"]["probe"]["successes"]
    reached = {
        "of the starts of probe end in success": (succeeded / card["episodes"], EXPERT_FLOOR),
        "of the recorded motions are tracked": (imitation["tracked"], TRACKED_FLOOR),
        "is the success of KODex": (imitation["kodex"], KODEX_FLOORS.get(card["task"], 0.0)),
    }
    return [
        f"{value:.2%} {what}, at least {floor:.0%} is needed"
        for what, (value, floor) in reached.items()
        if value < floor
    ]
