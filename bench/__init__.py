"""The protocol: what is fitted, how it is evaluated, and where results are kept."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

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
    """Computes and stores what is missing of a study; the same call again goes on.

    Args:
        study: name of a preset, or a study of one's own, as ``replace(get_preset("quick"), ...)``.
        folder: the results folder, made if need be.
        jobs: processes at a time; one for each core unless told.
        backend: loky, dask, or the name under which another is registered with joblib.
        scheduler: address of a dask scheduler.

    Raises:
        InputError: the study asks for what does not exist, or another run writes to the folder.
    """
    from bench.backend import Workers
    from bench.driver import default_jobs
    from bench.driver import run as run_study
    from bench.presets import get_preset

    chosen = get_preset(study) if isinstance(study, str) else study
    return run_study(chosen, Path(folder), Workers(jobs or default_jobs(), backend, scheduler))


def load(folder: str | Path) -> pd.DataFrame:
    """Returns every stored episode of a results folder in one long table.

    Columns: ``task``, ``method``, ``variant``, ``size``, ``demos``, ``seed``, ``split``,
    ``physics``, ``controller``, ``rule``, ``start``, ``success``, ``diverged`` and ``steps``.

    Raises:
        InputError: the folder holds no results.
    """
    from bench.store import Store, episodes_table

    return episodes_table(Store(Path(folder)))
