"""Records demonstrations of a user's policy, which runs in separate processes."""

import os
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np

from bench.isolation import Failure, apart
from tasks.data import BoolArray, Demos, FloatArray, Starts, real
from tasks.errors import InputError, described, unknown_name
from tasks.recorder import collect, record
from tasks.registry import get_task
from tasks.simulator import Simulator
from tasks.words import count_of

Attempt = tuple[BoolArray, Demos]
"""Whether the policy succeeded from each start (B,), and its successful episodes."""


def record_policy(
    task: str, place: str, count: int, tell: Callable[[str], None]
) -> tuple[BoolArray, Demos]:
    """Returns whether a policy succeeded from each start tried (B,), and its demonstrations.

    Each block of starts has its own process, which loads the policy again.

    Args:
        task: name of a task.
        place: where the policy is, ``FILE.py:NAME`` or ``MODULE:NAME``, see `load_policy`.
        count: number of demonstrations.
        tell: is called with lines about the progress.

    Raises:
        InputError: the policy cannot be used, or succeeds from fewer than one start in ten.
    """
    check_place(place)

    successes = 0

    def attempt(starts: Starts) -> Attempt:
        nonlocal successes
        found = _attempt_apart(task, place, starts)
        successes += int(found[0].sum())
        tried = count_of(int(starts.index[-1]) + 1, "start")
        tell(f"{tried} tried, {count_of(successes, 'success', 'successes')} found, {count} wanted")
        return found

    return collect(get_task(task), count, place, attempt)


def _attempt_apart(task: str, place: str, starts: Starts) -> Attempt:
    found: Attempt = apart(_attempt, task, place, starts, os.getcwd())
    return found


def _attempt(task: str, place: str, starts: Starts, folder: str) -> Attempt | Failure:
    """Records episodes from a block of starts, in the working folder of the command."""
    os.chdir(folder)
    try:
        return record(get_task(task), starts, OwnPolicy(place, load_policy(place)))
    except InputError as error:
        return Failure(str(error), "")


def check_place(place: str) -> None:
    """Raises InputError unless a place has the form of `load_policy` and its file exists."""
    source, _, name = place.rpartition(":")
    if not source or not name.isidentifier():
        raise InputError(
            f"--policy takes FILE.py:NAME or MODULE:NAME, such as my_policy.py:act, got {place!r}"
        )
    if source.endswith(".py") and not Path(source).is_file():
        raise InputError(f"--policy {place}: the file {source} does not exist")


def load_policy(place: str) -> Any:
    """Returns the policy at a place. Imports its code, so call it in a separate process.

    Args:
        place: ``FILE.py:NAME``, or ``MODULE:NAME`` of an installed module. NAME is a function, an
            object, or a class whose constructor needs no arguments.

    Raises:
        InputError: the module cannot be imported, or has no policy of that name.
    """
    source, _, name = place.rpartition(":")
    try:
        module = _module_of(Path(source)) if source.endswith(".py") else import_module(source)
    except Exception as error:
        raise InputError(f"{source} cannot be imported: {described(error)}") from error
    if not hasattr(module, name):
        known = [one for one, value in vars(module).items() if one[0] != "_" and callable(value)]
        raise unknown_name(f"policy of {source}", name, known)
    found = getattr(module, name)
    policy = found() if isinstance(found, type) else found
    if not (callable(policy) or callable(getattr(policy, "act", None))):
        raise InputError(
            f"{place} is a {type(policy).__name__}: a policy is a function act(state, t), or an"
            " object with a method act"
        )
    return policy


def _module_of(file: Path) -> Any:
    """The module of a file, which may import modules of its folder."""
    sys.path.insert(0, str(file.absolute().parent))
    spec = spec_from_file_location(file.stem, file)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[file.stem] = module
    spec.loader.exec_module(module)
    return module


class OwnPolicy:
    """A user's policy, which gets only states and time steps."""

    def __init__(self, place: str, policy: Any) -> None:
        self._place, self._policy = place, policy
        self._act = getattr(policy, "act", policy)

    def reset(self, simulator: Simulator) -> None:
        """Passes the first states to the policy, if it has a method ``reset``."""
        if hasattr(self._policy, "reset"):
            self._policy.reset(simulator.state())

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the policy's actions (B, A).

        Raises:
            InputError: they have another shape, or are not finite.
        """
        what = f"what {self._place} returns at t = {step}"
        actions = real(what, self._act(simulator.state(), step))
        expected = (len(simulator.starts), simulator.task.layout.action_dim)
        if actions.shape != expected:
            raise InputError(f"{what} must have shape (B, A) = {expected}, got {actions.shape}")
        bad = np.flatnonzero(~np.isfinite(actions).all(axis=1) & simulator.running)
        if bad.size:
            raise InputError(
                f"{what} must be finite; it is not for {bad.size} of"
                f" {count_of(len(actions), 'start')}"
            )
        return actions
