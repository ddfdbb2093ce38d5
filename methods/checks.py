"""Whether a method keeps the contract of `methods.base`, rule by rule, on a toy system.

Each rule is a function of a method's class that raises `RuleBrokenError` with the reason. To test a
method of one's own:

    @pytest.mark.parametrize("rule", RULES)
    def test_my_method(rule):
        RULES[rule](MyMethod)
"""

import json
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, is_dataclass
from functools import cache
from time import perf_counter
from typing import Any

import numpy as np
from safetensors.numpy import load

from methods.base import ActionMethod, Method, MotionMethod, NotFittedError, shortened
from tasks.data import Demos, FloatArray, Layout, Starts, generator
from tasks.files import to_bytes

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


def check(method: type[Method]) -> Iterator[Verdict]:
    """Yields the verdict of each rule as it comes; an error of the method's own breaks the rule."""
    for name, rule in RULES.items():
        began = perf_counter()
        try:
            rule(method)
            message = ""
        except Exception as error:
            message = str(error) if isinstance(error, RuleBrokenError) else repr(error)
        yield Verdict(name, not message, message, perf_counter() - began)


# The toy
def toy(first: int, count: int) -> Demos:
    """Returns demonstrations of a hand that swings towards where the object is.

    Made anew each time, since a method under test may write to them.
    """
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


def _fit(method: type[Method], seed: int = 1) -> Method:
    fitted = method(_config(method), LAYOUT)
    fitted.fit(toy(0, 40), toy(1, 10), seed)
    return fitted


_fitted = cache(_fit)


def _answer(method: Method, states: FloatArray) -> Any:
    """The motion, or the action after no step, for states (B, D)."""
    if isinstance(method, MotionMethod):
        return method.rollout(states, HORIZON - 1)
    assert isinstance(method, ActionMethod)
    method.reset(states)
    return method.act(states, 0)


def _starts() -> FloatArray:
    return toy(2, 8).states[:, 0]


def _require(holds: bool, message: str) -> None:
    if not holds:
        raise RuleBrokenError(message)


# The rules
def described(method: type[Method]) -> None:
    """It says what it is: name, sizes, variants, and configs that are frozen and JSON."""
    _require(issubclass(method, MotionMethod | ActionMethod), "it is of neither kind of method")
    _require(bool(method.name) and method.name.isidentifier(), f"name {method.name!r} is no name")
    _require(bool(method.sizes), "sizes is empty")
    _require("described" in method.variants, "variants lacks 'described'")
    for size, config in method.sizes.items():
        frozen = is_dataclass(config) and type(config).__setattr__ is not object.__setattr__
        _require(frozen, f"the config of size {size!r} is no frozen dataclass")
        try:
            json.dumps(asdict(config))
        except TypeError as error:
            raise RuleBrokenError(f"the config of size {size!r} cannot be JSON: {error}") from error
        for variant, changes in method.variants.items():
            unknown = set(changes) - {field.name for field in fields(config)}
            _require(not unknown, f"variant {variant!r} sets {unknown}, which {size!r} has not")
    for task, size in method.default_size.items():
        _require(size in method.sizes, f"default_size of {task!r} is {size!r}, not among sizes")


def unfitted_raises(method: type[Method]) -> None:
    """Before `fit` or `load` there is no answer but NotFittedError."""
    fresh = method(_config(method), LAYOUT)
    try:
        _answer(fresh, _starts())
    except NotFittedError:
        return
    raise RuleBrokenError("it answered although it was not fitted")


def shapes(method: type[Method]) -> None:
    """Motions are (B, steps + 1, D or H), actions (B, A)."""
    starts = _starts()
    found = np.shape(_answer(_fitted(method), starts))
    if issubclass(method, MotionMethod):
        allowed: list[tuple[int, ...]] = [
            (len(starts), HORIZON, k) for k in (LAYOUT.state_dim, LAYOUT.robot_dim)
        ]
    else:
        allowed = [(len(starts), LAYOUT.action_dim)]
    _require(found in allowed, f"the answer has shape {found}, allowed are {allowed}")


def dtype(method: type[Method]) -> None:
    """Answers are NumPy arrays of floats."""
    answer = _answer(_fitted(method), _starts())
    _require(isinstance(answer, np.ndarray), f"the answer is a {type(answer).__name__}")
    _require(np.issubdtype(answer.dtype, np.floating), f"the answer holds {answer.dtype}")


def finite(method: type[Method]) -> None:
    """Answers are finite where the demonstrations were."""
    _require(bool(np.isfinite(_answer(_fitted(method), _starts())).all()), "a number is not finite")


def begins_at_the_start(method: type[Method]) -> None:
    """The first row of a motion is its start."""
    if issubclass(method, MotionMethod):
        starts = _starts()
        first = _answer(_fitted(method), starts)[:, 0]
        apart = np.abs(first - starts[:, : first.shape[1]]).max()
        _require(apart == 0, f"the first row of a motion is {apart:g} away from its start")


def same_seed_same_answer(method: type[Method]) -> None:
    """Two fits with one seed give the same bits."""
    first, second = (_answer(m, _starts()) for m in (_fitted(method), _fit(method)))
    _require(np.array_equal(first, second), "two fits with the same seed answer differently")


def seeds_alone_or_together(method: type[Method]) -> None:
    """`fit_seeds` gives what `fit` gives, seed by seed."""
    seeds = [1, 2, 3]
    together = method.fit_seeds(_config(method), LAYOUT, toy(0, 40), toy(1, 10), seeds)
    _require(len(together) == 3, f"fit_seeds gave {len(together)} methods for 3 seeds")
    for fitted, seed in zip(together, seeds, strict=True):
        alone = _answer(_fitted(method, seed), _starts())
        apart = np.abs(_answer(fitted, _starts()) - alone).max()
        _require(apart <= TOLERANCE, f"fit_seeds and fit are {apart:g} apart for seed {seed}")


def one_answer_if_deterministic(method: type[Method]) -> None:
    """Where `deterministic` is set, two seeds give the same bits."""
    if method.deterministic:
        first, second = (_answer(_fitted(method, seed), _starts()) for seed in (1, 2))
        same = np.array_equal(first, second)
        _require(same, "it says that it is deterministic, and two seeds answer differently")


def batch_invariance(method: type[Method]) -> None:
    """An answer does not depend on which others are asked for beside it."""
    starts, fitted = _starts(), _fitted(method)
    together = _answer(fitted, starts)
    alone = np.concatenate([_answer(fitted, starts[i : i + 1]) for i in range(len(starts))])
    apart = np.abs(together - alone).max()
    _require(apart <= TOLERANCE, f"answers alone and together are {apart:g} apart")


def inputs_untouched(method: type[Method]) -> None:
    """Neither demonstrations nor states are written to."""
    demos, validation, starts = toy(0, 40), toy(1, 10), _starts()
    arrays = [a for d in (demos, validation) for a in (d.states, d.velocities, d.actions)]
    arrays.append(starts)
    before = [array.copy() for array in arrays]
    fitted = method(_config(method), LAYOUT)
    fitted.fit(demos, validation, 1)
    _answer(fitted, starts)
    same = all(np.array_equal(a, b) for a, b in zip(arrays, before, strict=True))
    _require(same, "it wrote to an array that it was given")


def global_streams_untouched(method: type[Method]) -> None:
    """The global random streams of random, NumPy and torch are neither drawn from nor seeded."""
    with _seeded(2):
        before = _streams()
        _answer(_fit(method), _starts())
        after = _streams()
    moved = [name for name in before if before[name] != after[name]]
    _require(not moved, f"it moved the global random stream of {', '.join(moved)}")


def global_streams_unused(method: type[Method]) -> None:
    """The state of the global random streams changes nothing."""
    answers = []
    for seed in (3, 4):
        with _seeded(seed):
            answers.append(_answer(_fit(method), _starts()))
    _require(np.array_equal(*answers), "its answers depend on a global random stream")


def survives_storage(method: type[Method]) -> None:
    """What `parameters` returns, stored and loaded into another object, gives the same answers."""
    fitted = _fitted(method)
    stored = fitted.parameters()
    wrong = [name for name, array in stored.items() if not isinstance(array, np.ndarray)]
    _require(not wrong, f"parameters holds {wrong}, which are no NumPy arrays")
    again = method(_config(method), LAYOUT)
    again.load(load(to_bytes(stored)))
    same = np.array_equal(_answer(again, _starts()), _answer(fitted, _starts()))
    _require(same, "it answers differently once stored and loaded")


def sizes_grow(method: type[Method]) -> None:
    """Each size has more numbers to learn than the one before."""
    counts = {}
    for size in method.sizes:
        fitted = method(shortened(_config(method, size), 1), LAYOUT)
        fitted.fit(toy(0, 40), toy(1, 10), 1)
        counts[size] = sum(array.size for array in fitted.parameters().values())
    ordered = list(counts.values())
    _require(ordered == sorted(set(ordered)), f"numbers of parameters do not grow: {counts}")


def beats_holding_still(method: type[Method]) -> None:
    """It comes nearer to the demonstrated motions, or actions, than doing nothing does."""
    unseen, fitted = toy(2, 8), _fitted(method)
    if isinstance(fitted, MotionMethod):
        wanted = unseen.states[:, :, : LAYOUT.robot_dim]
        given = fitted.rollout(unseen.states[:, 0], HORIZON - 1)[:, :, : LAYOUT.robot_dim]
        still = np.broadcast_to(wanted[:, :1], wanted.shape)
    else:
        assert isinstance(fitted, ActionMethod)
        fitted.reset(unseen.states[:, 0])
        acted = [fitted.act(unseen.states[:, t], t) for t in range(HORIZON - 1)]
        wanted, given = unseen.actions, np.stack(acted, axis=1)
        still = np.zeros_like(wanted)
    error, bound = (np.abs(motion - wanted).mean() for motion in (given, still))
    _require(error < bound, f"its mean error is {error:.3g}, and holding still has {bound:.3g}")


RULES: dict[str, Callable[[type[Method]], None]] = {
    rule.__name__: rule
    for rule in (
        described,
        unfitted_raises,
        shapes,
        dtype,
        finite,
        begins_at_the_start,
        same_seed_same_answer,
        seeds_alone_or_together,
        one_answer_if_deterministic,
        batch_invariance,
        inputs_untouched,
        global_streams_untouched,
        global_streams_unused,
        survives_storage,
        sizes_grow,
        beats_holding_still,
    )
}


def _streams() -> dict[str, bytes]:
    import torch

    numpy: Any = np.random.get_state()  # noqa: NPY002
    return {
        "random": repr(random.getstate()).encode(),
        "NumPy": numpy[1].tobytes() + repr(numpy[2:]).encode(),
        "torch": torch.get_rng_state().numpy().tobytes(),
    }


@contextmanager
def _seeded(seed: int) -> Iterator[None]:
    """The global streams begin anew, and then go on where they were."""
    import torch

    before = random.getstate(), np.random.get_state(), torch.get_rng_state()  # noqa: NPY002
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002
    torch.manual_seed(seed)
    try:
        yield
    finally:
        random.setstate(before[0])
        np.random.set_state(before[1])  # noqa: NPY002
        torch.set_rng_state(before[2])
