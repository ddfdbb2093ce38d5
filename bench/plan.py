"""What a study will cost: its cells, those missing, and the time, memory and disk that they need.

The costs are those of `bench.costs`, times the factor of this machine, which a short calibration
measures. A method of a package is not among them: the fit of a few demonstrations for an epoch or
two is measured here and now. What is measured is CPU time, which other work hardly adds to.
"""

import os
import shutil
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from statistics import fmean
from time import process_time

from bench.admission import guests
from bench.checking import known
from bench.clock import schedule
from bench.costs import JOB_SECONDS
from bench.doing import say
from bench.driver import simulator_threads
from bench.experiments import cells_of, recipes_of
from bench.isolation import apart
from bench.machine import machine_factor, random_demos, warm_up
from bench.pending import pending
from bench.presets import Study
from bench.spec import Fit
from bench.store import Store
from bench.trained import trained
from methods.base import Method, shortened
from methods.registry import SUITE, introduced
from tasks.errors import InputError, reason_of
from tasks.registry import get_task
from tasks.words import count_of

BYTES_PER_STEP = 4
"""Of a stored episode: one reading after each control step."""
BYTES_PER_FIT = 5_000_000
"""About the largest there is, K of 763 observables."""
GIB_PER_JOB = 1.5
"""Memory of a job with the largest fits."""


@dataclass(frozen=True)
class Plan:
    """What a study will cost on this machine."""

    cells: int
    missing_controllers: int
    missing_fits: int
    missing_evaluations: int
    missing_episodes: int
    cpu_hours: float
    """Of one core, by the calibration."""
    wall_hours: float
    """With as many jobs as the run will have, each taking the next cell once it is free."""
    longest_hours: float
    """What the longest jobs of the rounds take, one after the other: more jobs do not help."""
    memory_gib: float
    disk_gib: float
    free_gib: float

    def check(self) -> None:
        """Raises InputError if memory or disk will not suffice."""
        if self.disk_gib > self.free_gib:
            raise InputError(
                f"the results take about {self.disk_gib:.1f} GiB, and {self.free_gib:.1f} GiB are"
                " free: choose fewer episodes, or another folder"
            )
        if self.memory_gib > total_memory():
            raise InputError(
                f"the jobs take about {self.memory_gib:.1f} GiB of memory, and this machine has"
                f" {total_memory():.1f}: choose fewer with --jobs"
            )


def make_plan(study: Study, folder: Path, jobs: int) -> Plan:
    """Returns what a study will cost, given what its results folder already holds."""
    with introduced() as introduce:
        return _priced(_with_usable_methods(study, introduce), folder, jobs)


def _priced(study: Study, folder: Path, jobs: int) -> Plan:
    cells = cells_of(study, recipes_of(study))
    say("listing what is missing")
    missing = pending(Store(folder), cells)
    missing = replace(missing, controllers=[c for c in missing.controllers if not trained(c)])
    say("measuring how fast this machine is")
    factor = machine_factor()
    work, walls = (
        {name: [factor * cost.seconds for cost in costs] for name, costs in phases.items()}
        for phases in (missing.costs(), missing.costs(simulator_threads(jobs)))
    )
    work["fits"] = walls["fits"] = blocks_seconds(missing.blocks, work["fits"])
    episodes = sum(count for _, count in missing.episodes)
    size = BYTES_PER_FIT * sum(map(len, missing.blocks)) + BYTES_PER_STEP * sum(
        count * get_task(cell.fit.task).horizon for cell, count in missing.episodes
    )
    return Plan(
        cells=len(cells),
        missing_controllers=len(missing.controllers),
        missing_fits=sum(map(len, missing.blocks)),
        missing_evaluations=len(missing.episodes),
        missing_episodes=episodes,
        cpu_hours=sum(map(sum, work.values())) / 3600,
        wall_hours=sum(schedule(sorted(seconds, reverse=True), jobs) for seconds in walls.values())
        / 3600,
        longest_hours=sum(max(seconds, default=0.0) for seconds in walls.values()) / 3600,
        memory_gib=GIB_PER_JOB * jobs,
        disk_gib=size / 2**30,
        free_gib=free_disk(folder)[1],
    )


def _with_usable_methods(study: Study, introduce: Callable[[type[Method]], None]) -> Study:
    usable = list(study.methods)
    for name in guests(study.methods):
        try:
            introduce(known(name))
        except InputError as error:
            print(f"bench: {error}; it is left out", file=sys.stderr)
            usable.remove(name)
    return replace(study, methods=tuple(usable))


def free_disk(folder: Path) -> tuple[Path, float]:
    """Returns what there is of the path to a folder, and what is free there [GiB]."""
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    return there, shutil.disk_usage(there).free / 2**30


def total_memory() -> float:
    """Returns the memory of this machine [GiB]."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30


# Calibration
def blocks_seconds(blocks: Sequence[Sequence[Fit]], costs: Sequence[float]) -> list[float]:
    """Returns the seconds of each block of fits; those of packages are measured.

    Fits of a method that fails in the calibration cost the mean of the other fits; a line on stderr
    says so.

    Args:
        blocks: what one job does each.
        costs: the seconds of blocks of this suite's methods; others are not looked at.
    """
    known = {i: costs[i] for i, fits in enumerate(blocks) if fits[0].method in SUITE}
    failed: dict[str, str] = {}
    for index, fits in enumerate(blocks):
        try:
            if index not in known:
                known[index] = fits_seconds(fits)
        except Exception as error:
            failed.setdefault(fits[0].method, reason_of(error))
    mean = fmean(seconds / len(blocks[i]) for i, seconds in known.items()) if known else 0.0
    price = "priced like the mean of the other fits" if known else "not counted"
    for method, reason in failed.items():
        print(f"bench: the calibration of {method} failed, {price}: {reason}", file=sys.stderr)
    return [known.get(i, mean * len(fits)) for i, fits in enumerate(blocks)]


def fits_seconds(fits: Sequence[Fit]) -> float:
    """Returns the CPU seconds of fits of a package's method that differ in their seeds alone.

    They grow in proportion to demonstrations and epochs.
    """
    one = fits[0]
    say(f"measuring what a fit of {one.method} ({one.size}) on {one.task} costs")
    unit = _unit_seconds(one.task, one.method, one.variant, one.size, len(fits))
    return JOB_SECONDS + unit * one.demos * float(one.config.get("epochs", 1))


@cache
def _unit_seconds(task_name: str, method: str, variant: str, size: str, seeds: int) -> float:
    """The seconds of fits for each demonstration and epoch."""
    return float(apart(_measured, task_name, method, variant, size, seeds))


def _measured(task_name: str, method: str, variant: str, size: str, seeds: int) -> float:
    """Fits 16 demonstrations for two epochs."""
    from methods.registry import get_method

    config = get_method(method, variant).sizes[size]
    config = replace(config, **get_method(method, variant).variants[variant])
    config = shortened(config, 2)
    epochs = getattr(config, "epochs", 1)
    training, validation = random_demos(task_name)
    layout = get_task(task_name).layout
    warm_up()
    began = process_time()
    fitted = get_method(method, variant).fit_seeds(
        config, layout, training, validation, range(1, seeds + 1)
    )
    seconds = process_time() - began
    if len(fitted) != seeds:
        raise InputError(
            f"fit_seeds returned {count_of(len(fitted), 'method')} for {count_of(seeds, 'seed')}"
        )
    return seconds / (epochs * len(training))
