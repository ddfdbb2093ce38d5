"""The benchmark: fits methods, evaluates them, and stores and opens results."""

from __future__ import annotations

import os
import sys
from importlib.abc import MetaPathFinder
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typing import Unpack

    import pandas as pd
    from numpy.typing import ArrayLike

    from bench.opened import Opened
    from bench.presets import Study
    from bench.runner import Outcome
    from bench.studies import Options
    from methods.base import Method
    from tasks.arrays import Replayed
    from tasks.data import Demos

__all__ = ["demos", "demos_from_arrays", "load", "open", "run", "save_weights"]


def run(
    study: str | Study,
    folder: str | Path,
    jobs: int | None = None,
    backend: str = "loky",
    scheduler: str | None = None,
    **options: Unpack[Options],
) -> Outcome:
    """Computes and stores the missing results of a study. Repeat the call to resume.

    Args:
        study: name of a preset, or your own study, such as ``replace(get_preset("quick"), ...)``.
        folder: results folder, created if needed.
        jobs: parallel processes; -1 for one per core. Default: BENCH_JOBS, else -1.
        backend: loky, dask, or the name of another backend that is registered with joblib.
        scheduler: address of a dask scheduler.
        options: changes to the preset, named like the options of `bench run`:
            ``experiments``, ``tasks``, ``methods``, ``sizes``, ``variants``, ``seeds``,
            ``episodes``, ``expert``, ``demos``, ``settings`` (``--set``) and ``weights``, see
            `bench.studies.Options`.

    Raises:
        InputError: the study names something that does not exist, jobs is 0, or another run
            writes to the folder.
    """
    from bench.backend import Workers
    from bench.cores import count_jobs
    from bench.driver import run as run_study
    from bench.studies import study_of
    from tasks.files import path_of

    where = Workers(count_jobs(jobs), backend, scheduler)
    return run_study(study_of(study, **options), path_of("folder", folder), where)


def open(folder: str | Path | None = None) -> Opened:
    """Opens results for reading: tables, fitted methods, single episodes.

    Args:
        folder: results folder of `bench run` or `bench pack`. Default: the shipped results.

    Raises:
        InputError: the folder holds no results, or is not a path.
    """
    from bench.opened import Opened

    return Opened(folder)


def load(folder: str | Path | None = None) -> pd.DataFrame:
    """Returns all stored episodes of a results folder in one table, one row each.

    Columns: ``task``, ``method``, ``variant``, ``size``, ``demos``, ``held_out``, ``seed``,
    ``split``, ``physics``, ``controller``, ``rule``, ``disturbance``, ``replan``, ``start``,
    ``success``, ``diverged`` and ``steps``.

    Args:
        folder: results folder of `bench run` or `bench pack`. Default: the shipped results.

    Raises:
        InputError: the folder holds no results.
    """
    return open(folder).episodes


def demos(task: str, file: str | Path | None = None, seed: int = 1) -> tuple[Demos, Demos]:
    """Returns a seed's training demonstrations of a task and its validation demonstrations.

    Args:
        task: name of a task.
        file: file of demonstrations, written by `bench demos record`. Default: the expert's
            demonstrations, which the first call records within a minute.
        seed: of a study, from 1. Each has demonstrations of its own, or its own order of a file's.

    Raises:
        InputError: the task does not exist, the seed is no whole number from 1, or the file holds
            no demonstrations of the task.
    """
    from bench.parsing import seed_of
    from tasks.demos import load_demos, read_demos, shuffled, split
    from tasks.files import path_of
    from tasks.registry import get_task

    chosen, one = get_task(task), seed_of(seed)
    if file is None:
        return split(load_demos(chosen, one))
    return split(shuffled(read_demos(chosen, path_of("file", file)), one))


def demos_from_arrays(
    task: str, *, actions: ArrayLike, starts: ArrayLike, states: ArrayLike | None = None
) -> Replayed:
    """Replays recorded actions from their starts and returns the resulting demonstrations.

    ``demos_from_arrays(...).save("mine.safetensors")`` writes the successful ones to a file for
    ``run(..., demos="mine.safetensors")``.

    Args:
        task: name of a task.
        actions: (N, T-1, A) normalised servo set-points, clipped to [-1, 1].
        starts: (N, P) what varies between episodes, see `bench describe TASK`.
        states: (N, T, D), used only for comparison with the replay, see `Replayed.drift`.

    Raises:
        InputError: an array is not real and finite or has another shape, or a start is outside
            the range of demonstrations.
    """
    from tasks.arrays import replay_arrays
    from tasks.registry import get_task

    return replay_arrays(get_task(task), actions, starts, states)


def save_weights(method: Method, file: str | Path) -> None:
    """Writes what a fitted method has learnt to a file for ``run(..., weights={"mine": file})``.

    Args:
        method: a fitted method.
        file: the file, replaced if it exists.

    Raises:
        NotFittedError: the method has learnt nothing.
        InputError: what it has learnt cannot be stored, or the file cannot be written.
    """
    from methods.saved import save
    from tasks.files import path_of, writable_file

    save(method, writable_file(path_of("file", file)))


def _in_the_way() -> str:
    """A message if another module has the name of a package of ours, else an empty text."""
    root = os.path.dirname(os.path.dirname(__file__))
    for name in ("methods", "tasks", "reports"):
        try:
            spec = find_spec(name)
        except ValueError:  # it is imported already, without a spec
            spec = None
        found = (spec and spec.origin) or ""
        if found and not _same(os.path.dirname(os.path.dirname(found)), root):
            return (
                f"{found} is in the way of the package {name!r} of kodex-bench: rename or remove"
                " it, or take its folder off PYTHONPATH"
            )
    return ""


def _same(one: str, other: str) -> bool:
    return one == other or (os.path.exists(one) and os.path.samefile(one, other))


class _Refusing(MetaPathFinder):
    """Refuses to import any module of this package, since none could import what it needs."""

    def find_spec(self, name: str, *where: Any) -> None:
        if name == "bench.cli":
            print(f"bench: {_fault}", file=sys.stderr)
            raise SystemExit(2)
        if name.startswith("bench."):
            raise ImportError(_fault)


_fault = _in_the_way()
if _fault:
    sys.meta_path.insert(0, _Refusing())
else:
    from tasks.pins import pin

    pin()  # before NumPy and torch are loaded
