"""Whether a method keeps the contract of `methods.base`, rule by rule, on a toy system.

Each rule is a function of a method's class that raises `RuleBrokenError` with the reason. Methods
are built, fitted, stored and loaded as in a run, by `methods.contract`. To test a method of your
own:

    @pytest.mark.parametrize("rule", RULES)
    def test_my_method(rule):
        RULES[rule](MyMethod)
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from time import perf_counter
from typing import Any

import numpy as np

from methods.base import ActionMethod, Method, MotionMethod, NotFittedError, shortened
from methods.contract import Learnt, actions, build, learn, loaded, motion, resolved
from methods.guard import guarded
from methods.names import check_label, check_method_name
from tasks.data import Demos, FloatArray, Layout, Starts, generator
from tasks.errors import described as error_line

LAYOUT = Layout(robot_dim=3, object_dim=2, action_dim=3)
HORIZON = 15
EPOCHS = 20
"""Bound of a config's ``epochs``: the toy is learnt in seconds."""
TOLERANCE = 1e-4


class RuleBrokenError(AssertionError):
    """A method does not keep a rule, for the reason that the message gives."""


@dataclass(frozen=True)
class Verdict:
    """What came of one rule."""

    rule: str
    passed: bool
    message: str
    seconds: float
    tried: bool = True
    """False for a rule that needs another one which is broken."""


def check(method: type[Method]) -> Iterator[Verdict]:
    """Yields the verdict of each rule as it comes.

    A rule that raises anything is broken. Where a method cannot be described, fitted or asked, the
    rules that need it are not tried.
    """
    broken = ""
    for name, rule in RULES.items():
        began = perf_counter()
        message = f"needs {broken}" if broken else _broken(rule, method)
        yield Verdict(name, not message, message, perf_counter() - began, tried=not broken)
        if message and name in NEEDED:
            broken = broken or name


def _broken(rule: Callable[[type[Method]], None], method: type[Method]) -> str:
    """Why a method breaks a rule, if it does."""
    try:
        rule(method)
    except RuleBrokenError as error:
        return str(error)
    except BaseException as error:
        return error_line(error)
    return ""


# The toy
def toy(first: int, count: int) -> Demos:
    """Returns demonstrations of a hand that swings towards where the object is."""
    rng = generator("toy system", first)
    place = rng.uniform(-1, 1, (count, 2))
    goal = np.concatenate([place, place.sum(axis=1, keepdims=True)], axis=1)
    q, v = np.zeros((2, count, 3))
    states, velocities = [], []
    for _ in range(HORIZON):
        states.append(np.concatenate([q, place], axis=1))
        velocities.append(v)
        v = v + 0.1 * (6 * (goal - q) - 3 * v)
        q = q + 0.1 * v
    x = np.stack(states, axis=1)
    starts = Starts("toy", "demo", first + np.arange(count), place)
    actions = np.clip(x[:, 1:, :3] - x[:, :-1, :3], -1, 1)
    return Demos(starts, x, np.stack(velocities, axis=1), actions)


def _config(method: type[Method], size: str | None = None) -> Any:
    return shortened(method.sizes[size or next(iter(method.sizes))], EPOCHS)


def learnt_toy(method: type[Method], seeds: Sequence[int] = (1,)) -> list[Learnt]:
    """Returns what the smallest size of a method learns from the toy, one item for each seed."""
    with guarded("toy"):
        return _learnt(method, seeds)


def _learnt(method: type[Method], seeds: Sequence[int] = (1,)) -> list[Learnt]:
    return learn(method, resolved(_config(method)), LAYOUT, toy(0, 40), toy(1, 10), seeds)


def loaded_toy(method: type[Method], parameters: bytes) -> Method:
    """Returns the method that has the parameters of `learnt_toy`."""
    return loaded(method, resolved(_config(method)), LAYOUT, parameters)


def answer(method: Method, states: FloatArray | None = None) -> FloatArray:
    """Returns the motions, or the actions after no step, for states (B, D). Default: the toy's."""
    states = _starts() if states is None else states
    if isinstance(method, MotionMethod):
        return motion(method, states, HORIZON - 1)
    assert isinstance(method, ActionMethod)
    method.reset(states.copy())
    return actions(method, states, 0)


@cache
def _fitted(method: type[Method], seed: int = 1) -> Method:
    (learnt,) = learnt_toy(method, [seed])
    return learnt.method


def _starts() -> FloatArray:
    return toy(2, 8).states[:, 0]


def _require(holds: bool, message: str) -> None:
    if not holds:
        raise RuleBrokenError(message)


def _same(first: FloatArray, second: FloatArray) -> bool:
    """Whether the bits are equal. NaN equals NaN: that numbers are finite is a rule of its own."""
    return np.array_equal(first, second, equal_nan=True)


def _apart(first: FloatArray, second: FloatArray) -> float:
    if first.shape != second.shape:
        return np.inf
    differ = np.where(np.isnan(first) & np.isnan(second), 0.0, first - second)
    return float(np.nan_to_num(np.abs(differ), nan=np.inf).max())


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
    fresh = build(method, resolved(_config(method)), LAYOUT)
    try:
        answer(fresh)
    except NotFittedError:
        return
    raise RuleBrokenError("it answered although it was not fitted")


def fits(method: type[Method]) -> None:
    """`fit` learns, writes to no demonstration, and what it has learnt can be stored and loaded."""
    _fitted(method)


def answers(method: type[Method]) -> None:
    """Motions are float arrays (B, steps + 1, D or H), actions (B, A)."""
    answer(_fitted(method))


def finite(method: type[Method]) -> None:
    """Answers are finite where the demonstrations were."""
    given = answer(_fitted(method))
    bad = np.argwhere(~np.isfinite(given))
    _require(not len(bad), f"{len(bad)} of {given.size} numbers are not finite, first at {bad[:1]}")


def begins_at_the_start(method: type[Method]) -> None:
    """The first row of a motion is its start."""
    if issubclass(method, MotionMethod):
        starts = _starts()
        first = answer(_fitted(method), starts)[:, 0]
        apart = _apart(first, starts[:, : first.shape[1]])
        _require(apart == 0, f"the first row of a motion is {apart:g} away from its start")


def same_seed_same_answer(method: type[Method]) -> None:
    """Two fits with one seed give the same bits."""
    (again,) = learnt_toy(method)
    same = _same(answer(_fitted(method)), answer(again.method))
    _require(same, "two fits with the same seed answer differently")


def same_start_same_answer(method: type[Method]) -> None:
    """The same question has the same answer, whatever was asked before."""
    fitted = _fitted(method)
    same = _same(answer(fitted), answer(fitted))
    _require(same, "it answers differently when it is asked again")


def seeds_alone_or_together(method: type[Method]) -> None:
    """`fit_seeds` gives what `fit` gives, seed by seed."""
    seeds = [1, 2, 3]
    for learnt, seed in zip(learnt_toy(method, seeds), seeds, strict=True):
        apart = _apart(answer(learnt.method), answer(_fitted(method, seed)))
        _require(apart <= TOLERANCE, f"fit_seeds and fit are {apart:g} apart for seed {seed}")


def one_answer_if_deterministic(method: type[Method]) -> None:
    """Where `deterministic` is set, two seeds give the same bits."""
    if method.deterministic:
        same = _same(answer(_fitted(method, 1)), answer(_fitted(method, 2)))
        _require(same, "it says that it is deterministic, and two seeds answer differently")


def batch_invariance(method: type[Method]) -> None:
    """An answer does not depend on which others are asked for beside it."""
    starts, fitted = _starts(), _fitted(method)
    alone = [answer(fitted, starts[i : i + 1]) for i in range(len(starts))]
    apart = _apart(answer(fitted, starts), np.concatenate(alone))
    _require(apart <= TOLERANCE, f"answers alone and together are {apart:g} apart")


def states_untouched(method: type[Method]) -> None:
    """States that it is asked about are not written to."""
    starts, fitted = _starts(), _fitted(method)
    asked = starts.copy()
    if isinstance(fitted, MotionMethod):
        fitted.rollout(asked, HORIZON - 1)
    else:
        assert isinstance(fitted, ActionMethod)
        fitted.reset(asked)
        fitted.act(asked, 0)
    _require(_same(asked, starts), "it wrote to the states that it was given")


def process_untouched(method: type[Method]) -> None:
    """Folder, environment, random streams, dtypes and the like stay as they are."""
    with guarded("untouched") as changed:
        answer(_learnt(method)[0].method)
    _require(not changed, f"it changed {', '.join(changed)}")


def global_streams_unused(method: type[Method]) -> None:
    """The seed is the only source of randomness: global random streams change nothing."""
    given = []
    for stream in (3, 4):
        with guarded("stream", stream):
            given.append(answer(_learnt(method)[0].method))
    _require(_same(*given), "its answers depend on a global random stream")


def survives_storage(method: type[Method]) -> None:
    """What `parameters` returns, stored and loaded into another object, gives the same answers."""
    with guarded("toy"):
        config = build(method, resolved(_config(method)), LAYOUT).config
        (fitted,) = method.fit_seeds(config, LAYOUT, toy(0, 40), toy(1, 10), [1])
    same = _same(answer(fitted), answer(_fitted(method)))
    _require(same, "it answers differently once stored and loaded")


def beats_holding_still(method: type[Method]) -> None:
    """It comes nearer to the demonstrated motions, or actions, than doing nothing does."""
    unseen, fitted = toy(2, 8), _fitted(method)
    if isinstance(fitted, MotionMethod):
        wanted = unseen.states[:, :, : LAYOUT.robot_dim]
        given = answer(fitted, unseen.states[:, 0])[:, :, : LAYOUT.robot_dim]
        still = np.broadcast_to(wanted[:, :1], wanted.shape)
    else:
        assert isinstance(fitted, ActionMethod)
        fitted.reset(unseen.states[:, 0])
        acted = [actions(fitted, unseen.states[:, t], t) for t in range(HORIZON - 1)]
        wanted, given = unseen.actions, np.stack(acted, axis=1)
        still = np.zeros_like(wanted)
    known = np.isfinite(given)
    error, bound = (np.abs(moved - wanted)[known].mean() for moved in (given, still))
    _require(error < bound, f"its mean error is {error:.3g}, and holding still has {bound:.3g}")


RULES: dict[str, Callable[[type[Method]], None]] = {
    rule.__name__: rule
    for rule in (
        described,
        unfitted_raises,
        fits,
        answers,
        finite,
        begins_at_the_start,
        same_seed_same_answer,
        same_start_same_answer,
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
"""The rules without which those after them cannot be tried."""
