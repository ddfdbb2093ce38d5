"""Records what a policy does in the simulator, as demonstrations."""

from collections.abc import Callable
from functools import partial

import numpy as np

from tasks.base import Task
from tasks.data import BoolArray, Demos, FloatArray, IntArray, Starts, UnclippedDemos, join_demos
from tasks.disturbances import UNDISTURBED
from tasks.disturbed import disturbed
from tasks.errors import InputError
from tasks.masses import NOMINAL
from tasks.simulator import CHUNK, Policy, Simulator, rollout
from tasks.words import count_of

BLOCK = 300
"""Number of starts that `collect` tries at a time."""


class TooFewError(InputError):
    """A policy succeeds too rarely to demonstrate."""


class Recorder:
    """Wraps a policy and records the states that it sees and the actions that it takes."""

    def __init__(self, policy: Policy, raw: bool = False) -> None:
        """Wraps a policy; with ``raw=True``, its actions are recorded before clipping."""
        self.policy, self.raw = policy, raw

    def reset(self, simulator: Simulator) -> None:
        """Clears the recording and resets the policy."""
        self.policy.reset(simulator)
        self._simulator = simulator
        self._states: list[FloatArray] = []
        self._velocities: list[FloatArray] = []
        self._actions: list[FloatArray] = []

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the policy's actions (B, A)."""
        actions = self.policy.act(simulator, step)
        self._see()
        self._actions.append(actions if self.raw else np.clip(actions, -1.0, 1.0))
        return actions

    def _see(self) -> None:
        self._states.append(self._simulator.state())
        self._velocities.append(self._simulator.velocities())

    def finish(self, rows: IntArray) -> Demos:
        """Returns the recordings of some episodes. Call it once, after the last step."""
        self._see()
        seen = (self._states, self._velocities, self._actions)
        states, velocities, actions = (np.stack(part, axis=1)[rows] for part in seen)
        kind = UnclippedDemos if self.raw else Demos
        return kind(self._simulator.starts[rows], states, velocities, actions)


def record(
    task: Task,
    starts: Starts,
    policy: Policy,
    physics: str = NOMINAL,
    threads: int = 0,
    failures: bool = False,
    raw: bool = False,
    disturbance: str = UNDISTURBED,
) -> tuple[BoolArray, Demos]:
    """Runs a policy; returns its success at each start (B,), and its successful episodes.

    Args:
        task: the task.
        starts: the starts of the B episodes.
        policy: the policy.
        physics: name of a variation of appendix I.
        threads: number of threads; 0 for one per core.
        failures: also return failed episodes, except diverged ones.
        raw: return actions as the policy returned them, instead of clipped to [-1, 1].
        disturbance: what disturbs the episodes, see `tasks.disturbances`. What the policy read
            and answered is recorded.
    """
    success, found = [], []
    for first in range(0, len(starts), CHUNK):
        recorder = Recorder(policy, raw)
        part = starts[first : first + CHUNK]
        driver = disturbed(recorder, disturbance, task)
        episodes = rollout(task, part, driver, physics, threads=threads, whole=True)
        success.append(episodes.success)
        kept = ~episodes.diverged if failures else episodes.success
        found.append(recorder.finish(np.flatnonzero(kept)))
    return np.concatenate(success), join_demos(found)


def make_demos(
    task: Task,
    expert: Policy,
    n: int,
    seed: int = 0,
    threads: int = 0,
    disturbance: str = UNDISTURBED,
) -> Demos:
    """Returns an expert's first n successful episodes from the starts ``demo`` of a seed.

    Raises:
        InputError: fewer than one episode in ten succeeds.
    """
    attempt = partial(record, task, policy=expert, threads=threads, disturbance=disturbance)
    return collect(task, n, "the expert", attempt, seed)[1]


def collect(
    task: Task,
    n: int,
    who: str,
    attempt: Callable[[Starts], tuple[BoolArray, Demos]],
    seed: int = 0,
) -> tuple[BoolArray, Demos]:
    """Tries starts of the split ``demo``, in order, until n episodes have succeeded.

    Returns the success at each start that was tried, and the n demonstrations.

    Args:
        task: the task.
        n: number of demonstrations.
        who: names the policy in the error message.
        attempt: returns its success at each start (B,), and the successful episodes.
        seed: of the starts, see `tasks.base.Task.sample`.

    Raises:
        TooFewError: fewer than one episode in ten succeeds.
    """
    success = np.zeros(0, np.bool_)
    found: list[Demos] = []
    while success.sum() < n:
        starts = task.sample("demo", len(success) + BLOCK, seed)[len(success) :]
        tried, demos = attempt(starts)
        success = np.concatenate([success, tried])
        found.append(demos)
        if 10 * success.sum() < len(success):
            raise TooFewError(
                f"{who} succeeded in {success.sum()} of {count_of(len(success), 'episode')} of"
                f" {task.name}, fewer than one in ten, which is too few to learn from; actions are"
                f" set-points in [-1, 1], and `bench describe {task.name}` says when an episode"
                " succeeds"
            )
    return success, join_demos(found)[:n]
