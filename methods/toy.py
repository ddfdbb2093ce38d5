"""Made-up demonstrations, as long and as wide as a task's, and what a method learns from them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from methods.base import ActionMethod, Method, MotionMethod, shortened
from methods.contract import Learnt, actions, begin, fitted, loaded, motion, resolved, stored
from methods.guard import guarded
from tasks.data import CONTROL_STEP, Demos, FloatArray, Layout, Starts, generator

LAYOUT = Layout(robot_dim=28, object_dim=7, action_dim=28)
"""Of Door."""
HORIZON = 100
"""T of the longest task of the suite, so that a check covers every step of a run."""
EPOCHS = 3
"""Bound of a config's ``epochs``, where nothing depends on how well it learns."""

_PLACES = 0.3
"""Largest coordinate of an object [m]."""
_STIFFNESS, _DAMPING = 36.0, 12.0
"""Of joints that move to their goals within a second [1/s^2, 1/s]."""


def toy(first: int, count: int, layout: Layout = LAYOUT, horizon: int = HORIZON) -> Demos:
    """Returns demonstrations of a hand that moves to a posture, which depends on an object's place.

    Args:
        first: names the starts; the hand and what it does are always the same.
        count: N, how many.
        layout: the dimensions.
        horizon: T.
    """
    place = generator("toy starts", first).uniform(-_PLACES, _PLACES, (count, layout.object_dim))
    rng = generator("toy hand")
    posture = rng.uniform(0.4, 0.8, layout.robot_dim) * rng.choice([-1.0, 1.0], layout.robot_dim)
    goal = posture + place @ rng.uniform(-0.3, 0.3, (layout.object_dim, layout.robot_dim))
    q, v = np.zeros((2, count, layout.robot_dim))
    states, velocities = [], []
    for _ in range(horizon):
        states.append(np.concatenate([q, place], axis=1))
        velocities.append(v)
        v = v + CONTROL_STEP * (_STIFFNESS * (goal - q) - _DAMPING * v)
        q = q + CONTROL_STEP * v
    x = np.stack(states, axis=1)
    actions = np.clip(x[:, 1:, : layout.action_dim], -1, 1)  # set-points: where the joints go next
    starts = Starts("toy", "demo", first + np.arange(count), place)
    return Demos(starts, x, np.stack(velocities, axis=1), actions)


@dataclass(frozen=True)
class ToyFit:
    """What a method has learnt from made-up demonstrations."""

    fitted: Method
    """As the fit has left it."""
    learnt: Learnt
    """The same, stored and loaded."""
    changed: tuple[str, ...]
    """What of the process the fit had changed."""


def toy_fits(
    method: type[Method], seeds: Sequence[int] = (1,), stream: str = "toy", epochs: int = EPOCHS
) -> list[ToyFit]:
    """Returns what the smallest size of a method learns, one item for each seed.

    Args:
        method: what learns.
        seeds: each has its fit; several are fitted together.
        stream: seeds the global random streams.
        epochs: bound of a config's ``epochs``.

    Raises:
        ContractError: see `methods.contract.learn`.
    """
    values = toy_config(method, epochs)
    with guarded("check", stream) as changed:
        found = fitted(method, values, LAYOUT, toy(0, 12), toy(1, 4), seeds)
        learnt = [stored(one, values, LAYOUT) for one in found]
    return [ToyFit(*parts, tuple(changed)) for parts in zip(found, learnt, strict=True)]


def toy_config(method: type[Method], epochs: int = EPOCHS) -> dict[str, Any]:
    """Returns the smallest config of a method, with so many epochs at most."""
    return resolved(shortened(next(iter(method.sizes.values())), epochs))


def loaded_toy(method: type[Method], parameters: bytes) -> Method:
    """Returns the method that has the parameters of `toy_fits`."""
    return loaded(method, toy_config(method), LAYOUT, parameters)


def unseen() -> Demos:
    """Returns demonstrations that no method has learnt from."""
    return toy(2, 6)


def answer(method: Method, demos: Demos | None = None) -> FloatArray:
    """Returns the motions from the starts of demonstrations, or the actions along them.

    Motions are (B, T, D or H), actions (B, T - 1, A). Default: those of `unseen`.
    """
    demos = unseen() if demos is None else demos
    steps = demos.states.shape[1] - 1
    if isinstance(method, MotionMethod):
        return motion(method, demos.states[:, 0], steps)
    assert isinstance(method, ActionMethod)
    begin(method, demos.states[:, 0])
    return np.stack([actions(method, demos.states[:, t], t) for t in range(steps)], axis=1)
