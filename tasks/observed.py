"""Episodes of a task that is checked, with all that can be read on the way.

Random actions drive them, and the expert if the task has one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from tasks.base import Task
from tasks.data import BoolArray, FloatArray, Starts
from tasks.experts import experts_of, load_expert
from tasks.simulator import Policy, Simulator, rollout

COUNT = 6
"""Number of starts of a split from which episodes are observed."""


@dataclass(frozen=True)
class Seen:
    """What was seen in episodes. The second axis of arrays with T is the moments."""

    positions: FloatArray
    """(B, T, nq)"""
    velocities: FloatArray
    """(B, T, nv)"""
    states: FloatArray
    """(B, T, D)"""
    readings: FloatArray
    """(B, T) of the success rule."""
    watched: FloatArray
    """(B, T, W)"""
    actions: FloatArray
    """(B, T-1, A)"""
    success: BoolArray
    """(B,)"""
    diverged: BoolArray
    """(B,)"""

    @property
    def after_steps(self) -> FloatArray:
        """The readings (B, T-1) after each control step, as `Task.success` takes them."""
        return self.readings[:, 1:]


class Wander:
    """A policy of smooth random actions, which depend on the start alone."""

    def reset(self, simulator: Simulator) -> None:
        """Draws the actions."""
        streams, task = simulator.starts.streams("wander"), simulator.task
        shape = (task.steps, task.layout.action_dim)
        self._actions = np.array([0.3 * s.standard_normal(shape).cumsum(axis=0) for s in streams])

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the actions (B, A)."""
        return self._actions[:, step]


class Observer:
    """Wraps a policy and notes at each moment what a task reads."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._notes: list[tuple[FloatArray, ...]] = []
        self._actions: list[FloatArray] = []

    def reset(self, simulator: Simulator) -> None:
        """Notes the first moment."""
        self._policy.reset(simulator)
        self._simulator = simulator

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Notes the moment, and acts."""
        self._note()
        self._actions.append(self._policy.act(simulator, step))
        return self._actions[-1]

    def _note(self) -> None:
        simulator, batch = self._simulator, self._simulator.batch
        state, reading = simulator.state(), simulator.task.read(batch)
        watched = simulator.task.watch(batch)
        self._notes.append((batch.qpos.copy(), batch.qvel.copy(), state, reading, watched))

    def finish(self, success: BoolArray, diverged: BoolArray) -> Seen:
        """Notes the last moment, and returns what was seen."""
        self._note()
        positions, velocities, states, readings, watched = (
            np.stack(part, axis=1) for part in zip(*self._notes, strict=True)
        )
        actions = np.stack(self._actions, axis=1)
        return Seen(positions, velocities, states, readings, watched, actions, success, diverged)


def observe(task: Task, starts: Starts, policy: Policy, threads: int = 1) -> Seen:
    """Returns what is seen in whole episodes of a policy from starts."""
    observer = Observer(policy)
    found = rollout(task, starts, observer, chunk=len(starts), threads=threads, whole=True)
    return observer.finish(found.success, found.diverged)


def policies(task: Task) -> list[Callable[[], Policy]]:
    """Returns functions that make the policies that drive observed episodes."""
    return [Wander, lambda: load_expert(task).policy] if experts_of(task) else [Wander]


@cache
def seen(task: Task, split: str = "test") -> tuple[Seen, ...]:
    """Returns what is seen of each of the `policies`, once for all rules."""
    starts = task.sample(split, COUNT, 1)
    return tuple(observe(task, starts, make()) for make in policies(task))


@cache
def made(kind: type[Task]) -> Task:
    """Returns the object of a task's class that all rules share."""
    return kind()
