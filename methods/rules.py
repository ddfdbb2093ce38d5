"""The rules that every method keeps: the contract of `methods.base`, one function per rule.

A rule raises `RuleBrokenError` with the reason. `declared` checks a class as a whole, every other
rule one variant of it. Those of methods that see a state on the way are in
`methods.closed_loop_rules`. `methods.checks` runs them all.
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
from methods.contract import actions, begin, build, resolved
from methods.description import describe_method
from methods.guard import guarded
from methods.judging import TOLERANCE, difference, finite_part, longer, mean_error
from methods.registry import class_fault
from methods.subject import Subject, subjects
from methods.toy import HORIZON, LAYOUT, answer, streams, unseen
from tasks.names import check_name
from tasks.rule_results import RuleBrokenError, require


def declared(method: type[Method]) -> None:
    """The class has a name, a summary, sizes and variants, whose configs can be stored."""
    for attribute in ("name", "summary", "sizes", "default_size"):
        require(hasattr(method, attribute), f"it has no {attribute}")
    fault = class_fault(method, method.name)
    require(not fault, fault)
    if not method.__module__.startswith("methods."):
        check_name("method", method.name)
    describe_method(method)
    for subject in subjects(method):
        for size in subject.method.sizes:
            config = config_of(subject.method, size, subject.variant)
            build(subject.method, resolved(config), LAYOUT)
    for task, size in method.default_size.items():
        require(size in method.sizes, f"default_size of {task!r} is {size!r}, not among sizes")


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
        finite_part(subject)
        differ = np.abs(first - starts[:, : first.shape[1]])
        apart = float(np.max(differ[np.isfinite(differ)], initial=0.0))
        require(apart == 0, f"the first row of a motion is {apart:g} away from its start")


def same_start_same_answer(subject: Subject) -> None:
    """An answer does not depend on chance, nor on earlier requests, even if one was broken off."""
    loaded_again = answer(subject.load())
    require(
        difference(subject, loaded_again, subject.answer()) == 0,
        "it answers one request differently when it is loaded again: it may draw random numbers"
        " from the rngs of reset alone",
    )
    asked, others = subject.load(), unseen()[::-1]
    if isinstance(asked, MotionMethod):
        answer(asked, others)
        keeps = "rollout must keep nothing between calls"
    else:
        assert isinstance(asked, ActionMethod)
        begin(asked, others.states[:, 0], streams(others.starts))
        actions(asked, others.states[:, 0], 0)
        keeps = "reset must forget what earlier episodes left"
    same = difference(subject, answer(asked), subject.answer()) == 0
    require(same, f"it answers differently when it is asked again: {keeps}")


def same_seed_same_answer(subject: Subject) -> None:
    """Two fits with the same seed give the same bits."""
    again = answer(subject.refit().learnt.method)
    same = difference(subject, subject.answer(), again) == 0
    require(same, "two fits with the same seed answer differently")


def seeds_alone_or_together(subject: Subject) -> None:
    """An overridden `fit_seeds` gives for each seed what `fit` gives."""
    if not fits_together(subject.method):
        return
    for seed, found in enumerate(subject.fits([1, 2]), 1):
        apart = difference(subject, answer(found.learnt.method), subject.answer(seed))
        require(apart <= TOLERANCE, f"fit_seeds and fit are {apart:g} apart for seed {seed}")


def batch_invariance(subject: Subject) -> None:
    """An answer does not depend on the other starts in the batch."""
    demos, asked = unseen(), subject.load()
    alone = [answer(asked, demos[i : i + 1]) for i in range(len(demos))]
    apart = difference(subject, subject.answer(), np.concatenate(alone))
    require(apart <= TOLERANCE, f"answers alone and together are {apart:g} apart")


def states_untouched(subject: Subject) -> None:
    """`rollout`, `reset` and `act` do not write to the states that they are given."""
    demos, asked = unseen(), subject.load()
    given = [demos.states[:, t].copy() for t in range(HORIZON - 1)]
    if isinstance(asked, MotionMethod):
        asked.rollout(given[0], HORIZON - 1)
    else:
        assert isinstance(asked, ActionMethod)
        asked.reset(given[0], streams(demos.starts))
        for t, state in enumerate(given):
            asked.act(state, t)
    untouched = np.array_equal(np.stack(given, axis=1), demos.states[:, :-1])
    require(untouched, "it wrote to the states that it was given: change a copy")


def process_untouched(subject: Subject) -> None:
    """The current folder, environment, random streams, dtypes and the like stay unchanged."""
    with guarded("untouched") as changed:
        answer(subject.load())
    # The second fit counts: during the first, libraries load what they need.
    names = dict.fromkeys([*subject.refit().changed, *changed])
    require(not names, f"it changed {', '.join(names)}")


def global_streams_unused(subject: Subject) -> None:
    """The seed is the only source of randomness: answers ignore the global random streams."""
    (other,) = subject.fits(stream="another")
    same = difference(subject, subject.answer(), answer(other.learnt.method)) == 0
    require(same, "its answers depend on a global random stream")


def survives_storage(subject: Subject) -> None:
    """Parameters that are stored and loaded into another object give the same answers."""
    same = difference(subject, answer(subject.fit().fitted), subject.answer()) == 0
    require(same, "it answers differently once stored and loaded")


def beats_holding_still(subject: Subject) -> None:
    """Its mean error on unseen demonstrations is below that of a hand that does not move."""
    demos = unseen()
    if issubclass(subject.method, MotionMethod):
        wanted = demos.states[:, :, : LAYOUT.robot_dim]
        still = wanted[:, :1]
    else:
        wanted, still = demos.actions, np.zeros(1)
    finite_part(subject)
    bound = float(np.abs(wanted - still).mean())
    for method in longer(subject):
        error = mean_error(answer(method), wanted)
        if error < bound:
            return
    raise RuleBrokenError(
        f"its mean error is {error:.3g}, and holding still has {bound:.3g}: has it learnt, and are"
        " its answers in the units of the demonstrations?"
    )
