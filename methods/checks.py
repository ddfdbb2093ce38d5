"""Whether a method keeps the contract of `methods.base`, rule by rule, on made-up demonstrations.

They are as long and as wide as those of a task, see `methods.toy`; motions are asked for all their
steps, and actions at each of them. Each rule is a function of a method's class that raises
`RuleBrokenError` with the reason. Methods are built, fitted, stored and loaded as in a run, by
`methods.contract`. To test a method of your own:

    @pytest.mark.parametrize("rule", RULES)
    def test_my_method(rule):
        RULES[rule](MyMethod)
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from time import perf_counter

import numpy as np

from methods.base import ActionMethod, Method, MotionMethod, NotFittedError, fits_together
from methods.contract import ContractError, build, resolved
from methods.guard import guarded
from methods.names import check_label, check_method_name
from methods.toy import HORIZON, LAYOUT, ToyFit, answer, loaded_toy, toy_config, toy_fits, unseen
from tasks.data import BoolArray, FloatArray
from tasks.errors import described as error_line

MORE_EPOCHS = (20, 80)
"""Bounds of a config's ``epochs``, where a method does not show with fewer that it learns."""
TOLERANCE = 1e-3


class RuleBrokenError(AssertionError):
    """A method does not keep a rule, for the reason that the message gives."""


class UntriedError(Exception):
    """A rule cannot be tried without the one that the message names."""


@dataclass(frozen=True)
class Verdict:
    """What came of one rule."""

    rule: str
    passed: bool
    message: str
    seconds: float
    tried: bool = True
    """False for a rule that needs another one which is broken, or meets the same error; the message
    then begins with ``needs``, or ``meets the error of``, and names that one."""


def check(method: type[Method]) -> Iterator[Verdict]:
    """Yields the verdict of each rule as it comes.

    A rule that raises anything is broken. One that needs a broken rule, or meets the error of one,
    counts as not tried, so that what is broken is named once.
    """
    broken: dict[str, str] = {}
    """By rule that does not hold what the rules say that need it."""
    named: dict[str, str] = {}
    """By reason the first rule that is broken for it."""
    for name, rule in RULES.items():
        began = perf_counter()
        verdict = _verdict(name, rule, method, broken)
        if verdict.tried and verdict.message in named:
            same = f"meets the error of {named[verdict.message]}"
            verdict = replace(verdict, message=same, tried=False)
        if not verdict.passed:
            broken[name] = f"needs {name}" if verdict.tried else verdict.message
        if verdict.tried and not verdict.passed:
            named[verdict.message] = name
        yield replace(verdict, seconds=perf_counter() - began)


def _verdict(
    name: str,
    rule: Callable[[type[Method]], None],
    method: type[Method],
    broken: Mapping[str, str],
) -> Verdict:
    for needed in NEEDS.get(name, NEEDED):
        if needed in broken:
            return Verdict(name, False, broken[needed], 0.0, tried=False)
    try:
        rule(method)
    except UntriedError as error:
        return Verdict(name, False, f"needs {error}", 0.0, tried=False)
    except (RuleBrokenError, ContractError) as error:
        return Verdict(name, False, str(error), 0.0)
    except BaseException as error:
        return Verdict(name, False, error_line(error), 0.0)
    return Verdict(name, True, "", 0.0)


# What the rules ask of a method
@cache
def _fitted(method: type[Method], seed: int, time: int) -> ToyFit:
    (found,) = toy_fits(method, [seed])
    return found


def _fit(method: type[Method], seed: int = 1) -> ToyFit:
    return _fitted(method, seed, 1)


def _refit(method: type[Method]) -> ToyFit:
    """A second fit with the first seed."""
    return _fitted(method, 1, 2)


@cache
def _answered(method: type[Method], seed: int) -> FloatArray:
    return answer(_fit(method, seed).learnt.method)


def _answer(method: type[Method], seed: int = 1) -> FloatArray:
    """What a fit answers first, once stored and loaded."""
    return _answered(method, seed)


def first_answer(method: type[Method]) -> tuple[bytes, FloatArray]:
    """Returns the parameters of a fit, stored, and what the method answers once it has them."""
    return _fit(method).learnt.parameters, _answer(method)


def _again(method: type[Method]) -> Method:
    """The same fit, not asked anything yet."""
    return loaded_toy(method, _fit(method).learnt.parameters)


def _require(holds: bool, message: str) -> None:
    if not holds:
        raise RuleBrokenError(message)


def _known(method: type[Method]) -> BoolArray | None:
    """Which numbers of an answer are finite; None for all. What is not, `finite` has named."""
    known = np.isfinite(_answer(method))
    if not known.any():
        raise UntriedError("finite")
    return None if known.all() else known


def _apart(method: type[Method], first: FloatArray, second: FloatArray) -> float:
    """The largest difference of two answers; infinite where only one is finite."""
    known = _known(method)
    if first.shape != second.shape:
        return np.inf
    if known is not None and known.shape == first.shape:
        known = known & np.isfinite(first) & np.isfinite(second)
        first, second = first[known], second[known]
    if np.array_equal(first, second, equal_nan=True):
        return 0.0
    differ = np.nan_to_num(np.abs(first - second), nan=np.inf)
    return float(differ.max())


# The rules
def described(method: type[Method]) -> None:
    """It says what it is: name, sizes, variants, and configs that can be stored."""
    _require(issubclass(method, MotionMethod | ActionMethod), "it is of neither kind of method")
    for attribute in ("name", "summary", "sizes", "default_size"):
        _require(hasattr(method, attribute), f"it has no {attribute}")
    if not method.__module__.startswith("methods."):
        check_method_name(method.name)
    _require(bool(method.sizes), "sizes is empty")
    _require("described" in method.variants, "variants lacks 'described'")
    for size, config in method.sizes.items():
        check_label("size", size)
        frozen = is_dataclass(config) and type(config).__setattr__ is not object.__setattr__
        _require(frozen, f"the config of size {size!r} is no frozen dataclass")
        build(method, resolved(config), LAYOUT)
        for variant, changes in method.variants.items():
            check_label("variant", variant)
            unknown = set(changes) - {field.name for field in fields(config)}
            _require(not unknown, f"variant {variant!r} sets {unknown}, which {size!r} has not")
    for task, size in method.default_size.items():
        _require(size in method.sizes, f"default_size of {task!r} is {size!r}, not among sizes")


def unfitted_raises(method: type[Method]) -> None:
    """Before `fit` or `load` there is no answer but NotFittedError."""
    fresh = build(method, toy_config(method), LAYOUT)
    try:
        answer(fresh)
    except NotFittedError:
        return
    raise RuleBrokenError("it answered although it was not fitted")


def fits(method: type[Method]) -> None:
    """`fit` learns, writes to no demonstration, and what it has learnt can be stored and loaded."""
    _fit(method)


def answers(method: type[Method]) -> None:
    """Motions are float arrays (B, steps + 1, D or H), actions (B, A)."""
    _answer(method)


def finite(method: type[Method]) -> None:
    """Answers are finite at every step where the demonstrations were."""
    given = _answer(method)
    bad = np.argwhere(~np.isfinite(given).all(axis=2))
    if len(bad):
        motions = issubclass(method, MotionMethod)
        what, whose = ("rollout", "motions") if motions else ("act", "episodes")
        count, first = len(np.unique(bad[:, 0])), bad[:, 1].min()
        raise RuleBrokenError(
            f"{what} returned NaN or inf in {count} of {len(given)} {whose}, first at t={first}"
        )


def begins_at_the_start(method: type[Method]) -> None:
    """The first row of a motion is its start."""
    if issubclass(method, MotionMethod):
        first, starts = _answer(method)[:, 0], unseen().states[:, 0]
        _known(method)
        bad = np.abs(first - starts[:, : first.shape[1]])
        apart = float(np.max(bad[np.isfinite(bad)], initial=0.0))
        _require(apart == 0, f"the first row of a motion is {apart:g} away from its start")


def same_seed_same_answer(method: type[Method]) -> None:
    """Two fits with one seed give the same bits."""
    same = _apart(method, _answer(method), answer(_refit(method).learnt.method)) == 0
    _require(same, "two fits with the same seed answer differently")


def same_start_same_answer(method: type[Method]) -> None:
    """The same question has the same answer, whatever was asked before."""
    asked = _again(method)
    answer(asked)
    same = _apart(method, answer(asked), _answer(method)) == 0
    _require(same, "it answers differently when it is asked again")


def seeds_alone_or_together(method: type[Method]) -> None:
    """A `fit_seeds` of its own gives what `fit` gives, seed by seed."""
    if not fits_together(method):
        return
    for seed, found in enumerate(toy_fits(method, [1, 2]), 1):
        apart = _apart(method, answer(found.learnt.method), _answer(method, seed))
        _require(apart <= TOLERANCE, f"fit_seeds and fit are {apart:g} apart for seed {seed}")


def one_answer_if_deterministic(method: type[Method]) -> None:
    """Where `deterministic` is set, two seeds give the same bits."""
    if method.deterministic:
        same = _apart(method, _answer(method, 1), _answer(method, 2)) == 0
        _require(same, "it says that it is deterministic, and two seeds answer differently")


def batch_invariance(method: type[Method]) -> None:
    """An answer does not depend on which others are asked for beside it."""
    demos, asked = unseen(), _again(method)
    alone = [answer(asked, demos[i : i + 1]) for i in range(len(demos))]
    apart = _apart(method, _answer(method), np.concatenate(alone))
    _require(apart <= TOLERANCE, f"answers alone and together are {apart:g} apart")


def states_untouched(method: type[Method]) -> None:
    """States that it is asked about are not written to."""
    starts, asked = unseen().states[:, 0], _again(method)
    given = starts.copy()
    if isinstance(asked, MotionMethod):
        asked.rollout(given, HORIZON - 1)
    else:
        assert isinstance(asked, ActionMethod)
        asked.reset(given)
        asked.act(given, 0)
    _require(np.array_equal(given, starts), "it wrote to the states that it was given")


def process_untouched(method: type[Method]) -> None:
    """Folder, environment, random streams, dtypes and the like stay as they are."""
    with guarded("untouched") as changed:
        answer(_again(method))
    # Not of the first fit, during which libraries load what they need.
    names = dict.fromkeys([*_refit(method).changed, *changed])
    _require(not names, f"it changed {', '.join(names)}")


def global_streams_unused(method: type[Method]) -> None:
    """The seed is the only source of randomness: global random streams change nothing."""
    (other,) = toy_fits(method, stream="another")
    same = _apart(method, _answer(method), answer(other.learnt.method)) == 0
    _require(same, "its answers depend on a global random stream")


def survives_storage(method: type[Method]) -> None:
    """What `parameters` returns, stored and loaded into another object, gives the same answers."""
    same = _apart(method, answer(_fit(method).fitted), _answer(method)) == 0
    _require(same, "it answers differently once stored and loaded")


def beats_holding_still(method: type[Method]) -> None:
    """It comes nearer to the demonstrated motions, or actions, than doing nothing does."""
    demos = unseen()
    if issubclass(method, MotionMethod):
        wanted = demos.states[:, :, : LAYOUT.robot_dim]
        still = wanted[:, :1]
    else:
        wanted, still = demos.actions, np.zeros(1)
    _known(method)
    bound = float(np.abs(wanted - still).mean())
    error = _error(_answer(method), wanted)
    for epochs in MORE_EPOCHS:
        if error >= bound and toy_config(method, epochs) != toy_config(method):
            (found,) = toy_fits(method, epochs=epochs)
            error = _error(answer(found.learnt.method), wanted)
    _require(error < bound, f"its mean error is {error:.3g}, and holding still has {bound:.3g}")


def _error(given: FloatArray, wanted: FloatArray) -> float:
    differ = np.abs(given[..., : wanted.shape[-1]] - wanted)
    known = np.isfinite(differ)
    return float(differ[known].mean()) if known.any() else np.inf


RULES: dict[str, Callable[[type[Method]], None]] = {
    rule.__name__: rule
    for rule in (
        described,
        unfitted_raises,
        fits,
        answers,
        finite,
        begins_at_the_start,
        same_start_same_answer,
        same_seed_same_answer,
        seeds_alone_or_together,
        one_answer_if_deterministic,
        batch_invariance,
        states_untouched,
        process_untouched,
        global_streams_unused,
        survives_storage,
        beats_holding_still,
    )
}
NEEDED = ("described", "fits", "answers")
"""The rules that a rule needs, unless `NEEDS` says otherwise."""
REPEATS = (*NEEDED, "same_start_same_answer")
NEEDS = {
    "described": (),
    "unfitted_raises": NEEDED[:1],
    "fits": NEEDED[:1],
    "answers": NEEDED[:2],
    "same_seed_same_answer": REPEATS,
    "survives_storage": REPEATS,
    "batch_invariance": REPEATS,
    "seeds_alone_or_together": (*NEEDED, "same_seed_same_answer"),
    "one_answer_if_deterministic": (*NEEDED, "same_seed_same_answer"),
    "global_streams_unused": (*NEEDED, "same_seed_same_answer"),
}
