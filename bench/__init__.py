"""The protocol: what is fitted, how it is evaluated, and where results are kept."""

from __future__ import annotations

import os
import sys
from importlib.abc import MetaPathFinder
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

    from bench.driver import Outcome
    from bench.presets import Study

__all__ = ["load", "run"]


def run(
    study: str | Study,
    folder: str | Path,
    jobs: int | None = None,
    backend: str = "loky",
    scheduler: str | None = None,
) -> Outcome:
    """Computes and stores the missing results of a study. Repeat the call to resume.

    Args:
        study: name of a preset, or a study of one's own, as ``replace(get_preset("quick"), ...)``.
        folder: the results folder, made if need be.
        jobs: processes at a time; -1 for one on each core. Default: BENCH_JOBS, else -1.
        backend: loky, dask, or the name under which another is registered with joblib.
        scheduler: address of a dask scheduler.

    Raises:
        InputError: the study names something that does not exist, jobs is 0, or another run
            writes to the folder.
    """
    from bench.backend import Workers
    from bench.driver import count_jobs
    from bench.driver import run as run_study
    from bench.presets import get_preset

    chosen = get_preset(study) if isinstance(study, str) else study
    return run_study(chosen, Path(folder), Workers(count_jobs(jobs), backend, scheduler))


def load(folder: str | Path) -> pd.DataFrame:
    """Returns every stored episode of a results folder in one long table.

    Columns: ``task``, ``method``, ``variant``, ``size``, ``demos``, ``seed``, ``split``,
    ``physics``, ``controller``, ``rule``, ``start``, ``success``, ``diverged`` and ``steps``.

    Raises:
        InputError: the folder holds no results.
    """
    from bench.store import Store, episodes_table

    return episodes_table(Store(Path(folder)))


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
