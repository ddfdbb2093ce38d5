"""Simulates many episodes at once with ``mujoco.batch.Batch``, and detects divergence."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from tasks.base import Task
from tasks.data import Episodes, FloatArray, IntArray, Starts, real
from tasks.errors import InputError
from tasks.masses import NOMINAL
from tasks.physics import apply_physics

SUBSTEPS = 5
"""Physics steps of 2 ms in a control step of 10 ms, as in the Adroit environments."""
CHUNK = 500
"""Number of episodes that a policy sees at once. It is part of the protocol: the shape of a matrix
product changes its last bits, and contacts amplify them."""

_KINEMATICS_ONLY = int(
    mujoco.mjtDisableBit.mjDSBL_CONTACT
    | mujoco.mjtDisableBit.mjDSBL_LIMIT
    | mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    | mujoco.mjtDisableBit.mjDSBL_EQUALITY
    | mujoco.mjtDisableBit.mjDSBL_SENSOR
)
"""Switches off computations that positions of bodies and sites do not depend on."""


class Simulator:
    """B episodes of one task, all at the same time step.

    The number of episodes and of threads does not change a bit of an episode. An episode whose
    simulation becomes unstable is marked in ``diverged`` and no longer stepped.
    """

    def __init__(
        self, task: Task, starts: Starts, physics: str = NOMINAL, threads: int = 0
    ) -> None:
        """Places the episodes at their starts.

        Args:
            task: the task.
            starts: the starts of the B episodes.
            physics: name of a variation of appendix I.
            threads: number of threads; 0 for one per core.

        Raises:
            InputError: the starts are empty, of another task or out of range; or physics is
                unknown.
        """
        if len(starts) == 0:
            raise InputError("a simulator needs at least one start, got none")
        task.check_starts(starts)
        self.task = task
        self.starts = starts
        self.diverged = np.zeros(len(starts), np.bool_)
        self.running = np.ones(len(starts), np.bool_)
        """(B,) episodes that `step` advances. Clear an entry to stop its episode."""
        self.batch = Batch(task.model, len(starts), threads)
        apply_physics(task, physics, self.batch)
        task.place(self.batch, starts.values)
        low, high = task.model.actuator_ctrlrange.T
        self._middle, self._half_range = (low + high) / 2, (high - low) / 2
        self._disableflags = self.batch.expand("opt.disableflags")
        # Calls fill a field only after it is bound.
        for field in task.derived_fields:
            self.batch.bind(field)
        self.refresh()

    def step(self, actions: ArrayLike) -> None:
        """Advances the running episodes by one control step of 10 ms.

        Args:
            actions: (B, A) normalised servo set-points; they are clipped to [-1, 1]. A NaN makes
                its episode diverge.

        Raises:
            InputError: the actions have another shape, or are not real.
        """
        actions = real(f"actions of {self.task.name}", actions)
        expected = (len(self.starts), self.task.layout.action_dim)
        if actions.shape != expected:
            raise InputError(
                f"actions of {self.task.name} for these starts have shape (B, A) = {expected},"
                f" got {actions.shape}"
            )
        self.batch.ctrl[:] = self._middle + np.clip(actions, -1.0, 1.0) * self._half_range
        rows = np.flatnonzero(self.running)
        with _quiet():
            self.batch.step(rows, nstep=SUBSTEPS)
        self.mark_diverged()
        self.refresh(rows)

    def state(self) -> FloatArray:
        """Returns the current state x = [x_r, x_o], (B, D)."""
        return self.task.state(self.batch)

    def joints(self) -> FloatArray:
        """Returns the positions of the hand's joints, (B, H) [rad, m]."""
        return self.batch.qpos[:, : self.task.robot_dim].copy()

    def velocities(self) -> FloatArray:
        """Returns the velocities of the hand's joints, (B, H) [rad/s, m/s]."""
        return self.batch.qvel[:, : self.task.robot_dim].copy()

    def set_points(self) -> FloatArray:
        """Returns the actions (B, A) whose set-points the servos hold now."""
        return (self.batch.ctrl - self._middle) / self._half_range

    def observe(self) -> FloatArray:
        """Returns the environment's current observation, one row per episode."""
        with _quiet():
            return self.task.observe(self.batch)

    def read(self) -> FloatArray:
        """Returns the current reading of the success rule, (B,); NaN for diverged episodes."""
        return np.where(self.diverged, np.nan, self.task.read(self.batch))

    def refresh(self, rows: IntArray | None = None) -> None:
        """Recomputes the positions of bodies and sites from the state of the batch.

        They are out of date after a physics step, and after the state is written to.
        """
        self._disableflags |= _KINEMATICS_ONLY
        with _quiet():
            self.batch.forward(rows, stage=mujoco.mjtStage.mjSTAGE_POS)
        self._disableflags &= ~_KINEMATICS_ONLY

    def mark_diverged(self) -> None:
        """Marks episodes with a MuJoCo warning, or a state that causes one in the next step."""
        warned = self.batch.warning[:, :, 1].any(axis=1)
        moving = np.concatenate([self.batch.qpos, self.batch.qvel], axis=1)
        sound = (np.abs(moving) <= mujoco.mjMAXVAL).all(axis=1)
        self.diverged |= warned | ~sound
        self.running &= ~self.diverged


class Policy(Protocol):
    """Chooses the actions of a rollout."""

    def reset(self, simulator: Simulator) -> None:
        """Prepares for episodes that begin at the simulator's current state."""

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the actions (B, A) of control step ``step``, counting from 0."""


def rollout(
    task: Task,
    starts: Starts,
    policy: Policy,
    physics: str = NOMINAL,
    steps: int | None = None,
    chunk: int = CHUNK,
    threads: int = 0,
    whole: bool = False,
) -> Episodes:
    """Runs a policy from every start and returns the episodes.

    The policy always sees ``chunk`` episodes at once. The last chunk is padded with copies of its
    last start, which are not simulated. The policy runs on one thread.

    An episode ends as soon as its success is final: its later readings are NaN, and a later
    divergence goes unnoticed.

    Args:
        task: the task.
        starts: the starts of the B episodes.
        policy: chooses the actions.
        physics: name of a variation of appendix I.
        steps: number of control steps. Default: the task's.
        chunk: number of episodes that the policy sees at once.
        threads: number of simulator threads; 0 for one per core.
        whole: simulate every episode to its last step.

    Raises:
        InputError: see `Simulator`; or ``steps`` or ``chunk`` is below 1.
    """
    steps = task.steps if steps is None else steps
    for name, value in (("steps", steps), ("chunk", chunk)):
        if value < 1:
            raise InputError(f"{name} must be 1 or more, got {value}")
    task.check_starts(starts)
    taken = np.zeros(len(starts), np.int64)
    diverged = np.zeros(len(starts), np.bool_)
    readings = np.full((len(starts), steps), np.nan)
    # Another number of threads would round the policy's sums differently.
    with threadpool_limits(1):
        for first in range(0, len(starts), chunk):
            rows = np.arange(first, min(first + chunk, len(starts)))
            padded = np.pad(rows, (0, chunk - len(rows)), mode="edge")
            simulator = Simulator(task, starts[padded], physics, threads)
            simulator.running[len(rows) :] = False
            policy.reset(simulator)
            for step in range(steps):
                stepped = np.flatnonzero(simulator.running)
                simulator.step(policy.act(simulator, step))
                readings[first + stepped, step] = simulator.read()[stepped]
                taken[rows] += simulator.running[: len(rows)]
                if not whole:
                    done = task.decided(readings[rows, : step + 1], steps - step - 1)
                    simulator.running[: len(rows)] &= ~done
                if not simulator.running.any():
                    break
            diverged[rows] = simulator.diverged[: len(rows)]
    success = task.success(readings) & ~diverged
    return Episodes(starts, success, diverged, taken, readings)


@contextmanager
def _quiet() -> Iterator[None]:
    """Stops MuJoCo from logging to MUJOCO_LOG.TXT and the console; `diverged` has the facts."""
    log = mujoco.MjLogConfig.get()
    before = log.logto_file, log.logto_console
    log.logto_file = log.logto_console = False
    log.set()
    try:
        yield
    finally:
        log.logto_file, log.logto_console = before
        log.set()
