"""Record demonstrations of a policy of one's own, which runs in processes of their own."""

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
"""From which starts (B,) the policy succeeded, and what it did there."""


def record_policy(
    task: str, place: str, count: int, tell: Callable[[str], None]
) -> tuple[BoolArray, Demos]:
    """Returns from which starts tried (B,) a policy succeeded, and its first demonstrations.

    It starts anew for each block of starts, in a process of its own.

    Args:
        task: name of a task.
        place: of the policy, ``FILE.py:NAME`` or ``MODULE:NAME``, see `load_policy`.
        count: how many demonstrations.
        tell: takes lines that say how far it is.

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
    """Records from a block of starts, in the folder that the command was called in."""
    os.chdir(folder)
    try:
        return record(get_task(task), starts, OwnPolicy(place, load_policy(place)))
    except InputError as error:
        return Failure(str(error), "")


def check_place(place: str) -> None:
    """Raises InputError unless a place is written as one, and its file exists."""
    source, _, name = place.rpartition(":")
    if not source or not name.isidentifier():
        raise InputError(
            f"--policy takes FILE.py:NAME or MODULE:NAME, such as my_policy.py:act, got {place!r}"
        )
    if source.endswith(".py") and not Path(source).is_file():
        raise InputError(f"--policy {place}: the file {source} does not exist")


def load_policy(place: str) -> Any:
    """Returns the object of a place; imports the code there, and so is for processes of their own.

    Args:
        place: ``FILE.py:NAME``, or ``MODULE:NAME`` of an installed module. The name is that of a
            function, of an object, or of a class that is made without arguments.

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
            " object with such a method"
        )
    return policy


def _module_of(file: Path) -> Any:
    """The module of a file, which may import its neighbours."""
    sys.path.insert(0, str(file.absolute().parent))
    spec = spec_from_file_location(file.stem, file)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[file.stem] = module
    spec.loader.exec_module(module)
    return module


class OwnPolicy:
    """A policy of a user's, which sees states and time steps alone."""

    def __init__(self, place: str, policy: Any) -> None:
        self._place, self._policy = place, policy
        self._act = getattr(policy, "act", policy)

    def reset(self, simulator: Simulator) -> None:
        """Tells the policy where the episodes begin, if it wants to know."""
        if hasattr(self._policy, "reset"):
            self._policy.reset(simulator.state())

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the policy's actions (B, A).

        Raises:
            InputError: they are no finite numbers of that shape.
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
