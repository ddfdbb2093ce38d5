"""The protocol: what is fitted, how it is evaluated, and where results are kept."""

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
    from tasks.arrays import Replayed
    from tasks.data import Demos

__all__ = ["demos", "demos_from_arrays", "load", "open", "run"]


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
        study: name of a preset, or a study of one's own, as ``replace(get_preset("quick"), ...)``.
        folder: the results folder, made if need be.
        jobs: processes at a time; -1 for one on each core. Default: BENCH_JOBS, else -1.
        backend: loky, dask, or the name under which another is registered with joblib.
        scheduler: address of a dask scheduler.
        options: what differs from the preset, under the names of the options of `bench run`:
            ``experiments``, ``tasks``, ``methods``, ``sizes``, ``variants``, ``seeds``,
            ``episodes``, ``demos`` and ``settings`` (``--set``), see `bench.studies.Options`.

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
    """Opens results to read: tables, fitted methods, single episodes.

    Args:
        folder: of `bench run` or `bench pack`. Default: the shipped results.

    Raises:
        InputError: the folder holds no results, or is no path.
    """
    from bench.opened import Opened

    return Opened(folder)


def load(folder: str | Path | None = None) -> pd.DataFrame:
    """Returns every stored episode of a results folder in one long table.

    Columns: ``task``, ``method``, ``variant``, ``size``, ``demos``, ``seed``, ``split``,
    ``physics``, ``controller``, ``rule``, ``start``, ``success``, ``diverged`` and ``steps``.

    Args:
        folder: of `bench run` or `bench pack`. Default: the shipped results.

    Raises:
        InputError: the folder holds no results.
    """
    return open(folder).episodes


def demos(task: str, file: str | Path | None = None) -> tuple[Demos, Demos]:
    """Returns demonstrations of a task, those to train on and those for validation.

    Args:
        task: name of a task.
        file: of demonstrations, as `bench demos record` writes it. Default: the expert's, which
            are made on the first call, within minutes.

    Raises:
        InputError: there is no such task, or the file holds no demonstrations of it.
    """
    from tasks.demos import load_demos, read_demos, split
    from tasks.files import path_of
    from tasks.registry import get_task

    chosen = get_task(task)
    found = load_demos(chosen) if file is None else read_demos(chosen, path_of("file", file))
    return split(found)


def demos_from_arrays(
    task: str, *, actions: ArrayLike, starts: ArrayLike, states: ArrayLike | None = None
) -> Replayed:
    """Returns demonstrations made of recorded actions, which are replayed from their starts.

    ``demos_from_arrays(...).save("mine.safetensors")`` writes those that succeed to a file for
    ``run(..., demos="mine.safetensors")``.

    Args:
        task: name of a task.
        actions: (N, T-1, A) normalised servo set-points, clipped to [-1, 1].
        starts: (N, P) what varies from one episode to the next, see `bench describe TASK`.
        states: (N, T, D), only to be compared with those of the replay, see `Replayed.drift`.

    Raises:
        InputError: an array is not real and finite or has another shape, or a start is out of the
            range of demonstrations.
    """
    from tasks.arrays import replay_arrays
    from tasks.registry import get_task

    return replay_arrays(get_task(task), actions, starts, states)


def _in_the_way() -> str:
    """What other module goes by the name of a package of ours, and what to do; else nothing."""
    root = os.path.dirname(os.path.dirname(__file__))
    for name in ("methods", "tasks", "reports"):
        try:
            spec = find_spec(name)
        except ValueError:  # it was imported, and says nothing of where it is from
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
    """Refuses every module of this package, since none could import what it needs."""

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
