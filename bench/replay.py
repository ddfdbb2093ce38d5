"""Replays stored episodes bit for bit, to observe what their files do not hold.

The method gets all starts of a chunk, as in the run, but only the chosen episodes are simulated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.computing import make_policy
from bench.isolation import apart
from bench.jobs import stored_bytes
from bench.labels import plain
from bench.results import Results
from bench.rollout import TrackedMotion
from bench.spec import EXPERT
from bench.verify import stored_cell
from methods.guard import guarded
from methods.registry import SUITE
from tasks.data import Episodes, FloatArray, join_episodes
from tasks.disturbed import disturbed
from tasks.errors import InputError
from tasks.pins import pin
from tasks.registry import get_task
from tasks.simulator import CHUNK, Policy, Simulator, rollout


@dataclass(frozen=True)
class Replay:
    """Episodes of one stored evaluation, in the order of their starts."""

    episodes: Episodes
    watched: FloatArray
    """(B, T-1, W) readings that the task watches after each control step; NaN after the end."""
    joints: FloatArray
    """(B, T, H) positions of the hand's joints [rad, m]; NaN after the end."""
    planned: FloatArray | None
    """(B, T, H) the predicted motion; None if the method predicts actions."""


class Watcher:
    """A policy that acts like another one from some of the starts, and records what happens."""

    def __init__(self, policy: Policy, starts: Sequence[int]) -> None:
        self.policy, self.starts = policy, starts
        self._watched: list[FloatArray] = []
        self._joints: list[FloatArray] = []

    def reset(self, simulator: Simulator) -> None:
        """Stops the episodes from other starts."""
        self.policy.reset(simulator)
        self.simulator = simulator
        simulator.running &= np.isin(simulator.starts.index, self.starts)
        self.rows = np.flatnonzero(simulator.running)
        self._note()

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Returns the other policy's actions (B, A)."""
        if step:
            self._note()
        return self.policy.act(simulator, step)

    def _note(self) -> None:
        task, batch = self.simulator.task, self.simulator.batch
        self._watched.append(task.watch(batch)[self.rows])
        self._joints.append(batch.qpos[self.rows, : task.robot_dim])

    def finish(self, episodes: Episodes) -> Replay:
        """Returns the recorded episodes, once the rollout has ended."""
        self._note()
        rows, steps = self.rows, self.simulator.task.steps
        chosen = Episodes(
            episodes.starts[rows],
            episodes.success[rows],
            episodes.diverged[rows],
            episodes.steps[rows],
            episodes.readings[rows],
        )
        ended = np.isnan(chosen.readings)
        joints, watched = (_in_full(part, steps) for part in (self._joints, self._watched))
        joints[:, 1:][ended], watched[:, 1:][ended] = np.nan, np.nan
        planned = self.policy.motion[rows] if isinstance(self.policy, TrackedMotion) else None
        return Replay(chosen, watched[:, 1:], joints, planned)


def _in_full(seen: Sequence[FloatArray], steps: int) -> FloatArray:
    """Records of each moment, (B, steps + 1, ...); NaN once all episodes have ended."""
    found = np.full((len(seen[0]), steps + 1, seen[0].shape[1]), np.nan)
    found[:, : len(seen)] = np.stack(seen, axis=1)
    return found


def replay(
    folder: Path, row: Mapping[str, Any], starts: Sequence[int], whole: bool = False
) -> Replay:
    """Simulates stored episodes again and returns them with their motions.

    A method of a package runs in a separate process; so does every method if this process has other
    kernels.

    Args:
        folder: results folder of `bench run`.
        row: a row of `bench.source.Source.frame`, of the split ``test`` or ``ood``.
        starts: indices of one or more starts.
        whole: whether to continue after success is decided, which ends a stored episode.

    Raises:
        InputError: a start was not evaluated; the fit learnt from other demonstrations than this
            installation makes; or a method of a package cannot be used or fails.
    """
    check_starts(row, starts)
    wanted = [int(start) for start in sorted(starts)]
    if plain(row["method"]) in (EXPERT, *SUITE) and not pin().late:
        return _replay(folder, row, wanted, whole)
    # The other process may have another working folder.
    found: Replay = apart(_replay, folder.absolute(), row, wanted, whole)
    return found


def check_starts(row: Mapping[str, Any], starts: Sequence[int]) -> None:
    """Raises InputError unless there are starts, and all were evaluated, see `replay`."""
    beyond = [start for start in starts if not 0 <= start < row["episodes"]]
    if beyond or not len(starts):
        raise InputError(
            f"start {beyond[0] if beyond else 'none'} of {row['task']}/{row['split']} has no stored"
            f" episode of {row['method']}: there are 0 to {row['episodes'] - 1}"
        )


def _replay(folder: Path, row: Mapping[str, Any], starts: Sequence[int], whole: bool) -> Replay:
    results = Results(folder)
    cell = stored_cell(results, row, row["episodes"])
    evaluation, stored = cell.evaluation, stored_bytes(cell, results)
    task = get_task(evaluation.task, evaluation.rule)
    every = task.sample(evaluation.split, cell.episodes, cell.fit.seed)
    parts = []
    for first in sorted({start // CHUNK * CHUNK for start in starts}):
        with guarded(f"{cell.fit.label} {evaluation.name}", first):
            watcher = Watcher(make_policy(cell, *stored), starts)
            chunk = every[first : first + CHUNK]
            driver = disturbed(watcher, evaluation.disturbance, task)
            found = rollout(task, chunk, driver, evaluation.physics, whole=whole)
            parts.append(watcher.finish(found))
    planned = [part.planned for part in parts if part.planned is not None]
    return Replay(
        join_episodes([part.episodes for part in parts]),
        np.concatenate([part.watched for part in parts]),
        np.concatenate([part.joints for part in parts]),
        np.concatenate(planned) if planned else None,
    )
