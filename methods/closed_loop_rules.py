"""The rules of methods that see a state on the way: those that act, and those that replan.

`methods.rules` has the rules of all methods.
"""

from dataclasses import replace

import numpy as np

from methods.base import ActionMethod, Method, MotionMethod
from methods.contract import motion
from methods.judging import TOLERANCE, difference, longer, mean_error
from methods.subject import Subject
from methods.toy import HORIZON, LAYOUT, answer, unseen
from tasks.data import FloatArray, generator
from tasks.rule_results import RuleBrokenError, require


def ended_episodes_ignored(subject: Subject) -> None:
    """An action does not depend on episodes of the batch that have ended, and stand still."""
    if not issubclass(subject.method, ActionMethod):
        return
    demos, ended = unseen(), slice(None, None, 2)
    states = demos.states.copy()
    states[ended, HORIZON // 3 :] = states[ended, HORIZON // 3, None]
    found = answer(subject.load(), replace(demos, states=states))
    found[ended] = subject.answer()[ended]
    apart = difference(subject, found, subject.answer())
    require(
        apart <= TOLERANCE,
        f"actions are {apart:g} apart when other episodes have ended: treat each row alone",
    )


def actions_in_range(subject: Subject) -> None:
    """Actions are finite and in [-1, 1], also in states off the demonstrations."""
    if not issubclass(subject.method, ActionMethod):
        return
    demos = unseen()
    off = generator("off the demonstrations").uniform(-1.0, 1.0, demos.states.shape)
    found = answer(subject.load(), replace(demos, states=demos.states + off))
    require(
        bool(np.isfinite(found).all()),
        "act returned NaN or inf in a state off the demonstrations, where a push may lead",
    )
    largest = float(np.abs(found).max())
    require(
        largest <= 1,
        f"act returned {largest:.3g} off the demonstrations: clip actions to [-1, 1]",
    )


def replans_from_any_state(subject: Subject) -> None:
    """A method that replans predicts finite motions of any length from any demonstrated state."""
    if not subject.method.replans:
        return
    asked, on_the_way = _replanner(subject.load()), _on_the_way()
    for steps in (HORIZON - 1, 1):
        found = motion(asked, on_the_way, steps)
        require(bool(np.isfinite(found).all()), "its motion from a state on the way is not finite")
        begins = np.array_equal(found[:, 0], on_the_way[:, : found.shape[2]])
        require(begins, "its motion from a state on the way does not begin there")


def replans_alone_or_together(subject: Subject) -> None:
    """A motion from a state on the way does not depend on the other states in the batch."""
    if not subject.method.replans:
        return
    asked, on_the_way = _replanner(subject.load()), _on_the_way()
    together = motion(asked, on_the_way, HORIZON // 4)
    alone = [motion(asked, state[None], HORIZON // 4) for state in on_the_way]
    apart = float(np.abs(together - np.concatenate(alone)).max())
    require(
        apart <= TOLERANCE,
        f"motions from states on the way are {apart:g} apart alone and together: treat each row"
        " alone",
    )


def replans_onward(subject: Subject) -> None:
    """A motion from a state on the way goes on from there, and does not start over."""
    if not subject.method.replans:
        return
    states, now = unseen().states, HORIZON // 2
    hand = states[:, :, : LAYOUT.robot_dim]
    for method in longer(subject):
        found = motion(_replanner(method), states[:, now], HORIZON - 1 - now)
        follows = mean_error(found, hand[:, now:])
        begins = mean_error(found, hand[:, : HORIZON - now])
        if follows < begins:
            return
    raise RuleBrokenError(
        f"its motion from a state on the way is {follows:.3g} away from what follows there, and"
        f" {begins:.3g} from the beginning: it must go on from the state that it is given"
    )


def _replanner(method: Method) -> MotionMethod:
    if not isinstance(method, MotionMethod):
        raise RuleBrokenError("it says that it replans, but it predicts no motions")
    return method


def _on_the_way() -> FloatArray:
    """States of demonstrations (B, D), one early, one late, the others between."""
    states = unseen().states
    moments = np.linspace(HORIZON // 10, HORIZON - 2, len(states), dtype=int)
    return states[np.arange(len(states)), moments]
