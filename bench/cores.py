"""Numbers of processes and threads of a run, and what this machine has for them."""

import os

import joblib

from tasks.errors import InputError

LEAST_GIB = 0.5
"""Memory of the smallest job with its worker, in GiB."""


def count_jobs(jobs: int | None = None) -> int:
    """Returns the number of parallel jobs.

    Args:
        jobs: this number, or -1 for one per core. Default: BENCH_JOBS, else -1.

    Raises:
        InputError: the number is 0, below -1, or no whole number, or the memory of this machine is
            too small for so many.
    """
    name, text = ("jobs", str(jobs)) if jobs is not None else ("BENCH_JOBS", "")
    text = text or os.environ.get("BENCH_JOBS") or "-1"
    if text == "-1":
        return cores()
    if not text.isdecimal() or int(text) < 1:
        raise InputError(f"{name} must be 1 or more, or -1 for one per core, got {text!r}")
    if int(text) > max(cores(), most := int(total_memory() / LEAST_GIB)):
        raise InputError(
            f"{name} must be at most {max(cores(), most)} here, got {text}: a job takes"
            f" {LEAST_GIB:g} GiB of memory or more, and this machine has {total_memory():.0f}"
        )
    return int(text)


def simulator_threads(jobs: int) -> int:
    """Returns the simulator threads of each evaluation when this many jobs run in parallel."""
    return max(1, cores() // jobs)


def total_memory() -> float:
    """Returns the memory of this machine [GiB]."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30


def cores() -> int:
    """Returns the number of processor cores that this process may use."""
    return int(joblib.cpu_count())
