"""The rules that every method keeps: the contract of `methods.base`, one function per rule.

A rule raises `RuleBrokenError` with the reason. `declared` checks a class as a whole, every other
rule one variant of it. `methods.checks` runs them.
"""

import numpy as np

from methods.base import (
    ActionMethod,
    Method,
    MotionMethod,
    NotFittedError,
    config_of,
    fits_together,
)
from methods.contract import build, motion, resolved
from methods.description import describe_method
from methods.guard import guarded
from methods.names import check_method_name
from methods.registry import class_fault
from methods.subject import Subject, subjects
from methods.toy import HORIZON, LAYOUT, answer, streams, unseen
from tasks.data import BoolArray, FloatArray

MORE_EPOCHS = (20, 80)
"""Upper bounds of ``epochs`` that are tried in turn if fewer do not show that a method learns."""
TOLERANCE = 1e-3
"""Largest difference between answers that should be equal except for rounding."""


class RuleBrokenError(AssertionError):
    """A method breaks a rule; the message gives the reason."""


class UntriedError(Exception):
    """A rule cannot be tried because the rule that the message names is broken."""


def declared(method: type[Method]) -> None:
    """The class has a name, a summary, sizes and variants, whose configs can be stored."""
    for attribute in ("name", "summary", "sizes", "default_size"):
        _require(hasattr(method, attribute), f"it has no {attribute}")
    fault = class_fault(method, method.name)
    _require(not fault, fault)
    if not method.__module__.startswith("methods."):
        check_method_name(method.name)
    describe_method(method)
    for subject in subjects(method):
        for size in subject.method.sizes:
            config = config_of(subject.method, size, subject.variant)
            build(subject.method, resolved(config), LAYOUT)
    for task, size in method.default_size.items():
        _require(size in method.sizes, f"default_size of {task!r} is {size!r}, not among sizes")


def unfitted_raises(subject: Subject) -> None:
    """Before `fit` or `load`, a request for an answer raises NotFittedError."""
    try:
        answer(subject.build())
    except NotFittedError:
        return
    raise RuleBrokenError("it answered although it was not fitted")


def fits(subject: Subject) -> None:
    """`fit` leaves the demonstrations unchanged, and its parameters can be stored and loaded."""
    subject.fit()


def answers(subject: Subject) -> None:
    """Motions are float arrays (B, steps + 1, D or H), actions are (B, A)."""
    subject.answer()


def finite(subject: Subject) -> None:
    """Answers are finite at every step of finite demonstrations."""
    given = subject.answer()
    bad = np.argwhere(~np.isfinite(given).all(axis=2))
    if len(bad):
        motions = issubclass(subject.method, MotionMethod)
        what, whose = ("rollout", "motions") if motions else ("act", "episodes")
        count, first = len(np.unique(bad[:, 0])), bad[:, 1].min()
        raise RuleBrokenError(
            f"{what} returned NaN or inf in {count} of {len(given)} {whose}, first at t={first}"
        )


def begins_at_the_start(subject: Subject) -> None:
    """The first row of a motion is its start."""
    if issubclass(subject.method, MotionMethod):
        first, starts = subject.answer()[:, 0], unseen().states[:, 0]
        _finite_part(subject)
        differ = np.abs(first - starts[:, : first.shape[1]])
        apart = float(np.max(differ[np.isfinite(differ)], initial=0.0))
        _require(apart == 0, f"the first row of a motion is {apart:g} away from its start")


def same_start_same_answer(subject: Subject) -> None:
    """An answer does not depend on earlier requests."""
    asked = subject.load()
    answer(asked)
    same = _difference(subject, answer(asked), subject.answer()) == 0
    _require(same, "it answers differently when it is asked again")


def same_seed_same_answer(subject: Subject) -> None:
    """Two fits with the same seed give the same bits."""
    again = answer(subject.refit().learnt.method)
    same = _difference(subject, subject.answer(), again) == 0
    _require(same, "two fits with the same seed answer differently")


def seeds_alone_or_together(subject: Subject) -> None:
    """An overridden `fit_seeds` gives for each seed what `fit` gives."""
    if not fits_together(subject.method):
        return
    for seed, found in enumerate(subject.fits([1, 2]), 1):
        apart = _difference(subject, answer(found.learnt.method), subject.answer(seed))
        _require(apart <= TOLERANCE, f"fit_seeds and fit are {apart:g} apart for seed {seed}")


def batch_invariance(subject: Subject) -> None:
    """An answer does not depend on the other starts in the batch."""
    demos, asked = unseen(), subject.load()
    alone = [answer(asked, demos[i : i + 1]) for i in range(len(demos))]
    apart = _difference(subject, subject.answer(), np.concatenate(alone))
    _require(apart <= TOLERANCE, f"answers alone and together are {apart:g} apart")


def replans_from_any_state(subject: Subject) -> None:
    """A method that replans predicts a finite motion from a state on the way, and begins there."""
    if not subject.method.replans:
        return
    asked, on_the_way = subject.load(), unseen().states[:, HORIZON // 2]
    if not isinstance(asked, MotionMethod):
        raise RuleBrokenError("it says that it replans, but it predicts no motions")
    found = motion(asked, on_the_way, HORIZON // 4)
    _require(bool(np.isfinite(found).all()), "its motion from a state on the way is not finite")
    begins = np.array_equal(found[:, 0], on_the_way[:, : found.shape[2]])
    _require(begins, "its motion from a state on the way does not begin there")


def states_untouched(subject: Subject) -> None:
    """`rollout`, `reset` and `act` do not write to the states that they are given."""
    demos, asked = unseen(), subject.load()
    starts = demos.states[:, 0]
    given = starts.copy()
    if isinstance(asked, MotionMethod):
        asked.rollout(given, HORIZON - 1)
    else:
        assert isinstance(asked, ActionMethod)
        asked.reset(given, streams(demos.starts))
        asked.act(given, 0)
    _require(np.array_equal(given, starts), "it wrote to the states that it was given")


def process_untouched(subject: Subject) -> None:
    """The current folder, environment, random streams, dtypes and the like stay unchanged."""
    with guarded("untouched") as changed:
        answer(subject.load())
    # The second fit counts: during the first, libraries load what they need.
    names = dict.fromkeys([*subject.refit().changed, *changed])
    _require(not names, f"it changed {', '.join(names)}")


def global_streams_unused(subject: Subject) -> None:
    """The seed is the only source of randomness: answers ignore the global random streams."""
    (other,) = subject.fits(stream="another")
    same = _difference(subject, subject.answer(), answer(other.learnt.method)) == 0
    _require(same, "its answers depend on a global random stream")


def survives_storage(subject: Subject) -> None:
    """Parameters that are stored and loaded into another object give the same answers."""
    same = _difference(subject, answer(subject.fit().fitted), subject.answer()) == 0
    _require(same, "it answers differently once stored and loaded")


def beats_holding_still(subject: Subject) -> None:
    """Its mean error on unseen demonstrations is below that of a hand that does not move."""
    demos = unseen()
    if issubclass(subject.method, MotionMethod):
        wanted = demos.states[:, :, : LAYOUT.robot_dim]
        still = wanted[:, :1]
    else:
        wanted, still = demos.actions, np.zeros(1)
    _finite_part(subject)
    bound = float(np.abs(wanted - still).mean())
    error = _error(subject.answer(), wanted)
    for epochs in MORE_EPOCHS:
        if error >= bound and subject.values(epochs) != subject.values():
            (found,) = subject.fits(epochs=epochs)
            error = _error(answer(found.learnt.method), wanted)
    _require(error < bound, f"its mean error is {error:.3g}, and holding still has {bound:.3g}")


def _require(holds: bool, message: str) -> None:
    if not holds:
        raise RuleBrokenError(message)


def _finite_part(subject: Subject) -> BoolArray | None:
    """Which numbers of the first answer are finite; None for all.

    The rule `finite` reports the others, so the other rules leave them out.
    """
    finite_part = np.isfinite(subject.answer())
    if not finite_part.any():
        raise UntriedError("finite")
    return None if finite_part.all() else finite_part


def _difference(subject: Subject, first: FloatArray, second: FloatArray) -> float:
    """The largest difference of two answers; infinite where only one is finite."""
    known = _finite_part(subject)
    if first.shape != second.shape:
        return np.inf
    if known is not None and known.shape == first.shape:
        known = known & np.isfinite(first) & np.isfinite(second)
        first, second = first[known], second[known]
    if np.array_equal(first, second, equal_nan=True):
        return 0.0
    differ = np.nan_to_num(np.abs(first - second), nan=np.inf)
    return float(differ.max())


def _error(given: FloatArray, wanted: FloatArray) -> float:
    differ = np.abs(given[..., : wanted.shape[-1]] - wanted)
    known = np.isfinite(differ)
    return float(differ[known].mean()) if known.any() else np.inf
