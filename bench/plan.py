"""Estimates what a study costs: its missing results, and the time, memory and disk they need.

It also says which differences of methods the seeds can show, see `bench.detectable`.

Costs are those of `bench.costs`, times the factor of this machine, which a short calibration
measures. The table of costs has no methods of packages. For these, a fit to a few demonstrations
over one or two epochs is measured each time. Measured is CPU time, which other work hardly affects.
"""

import shutil
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import fmean
from time import process_time

from bench.admission import guests
from bench.agenda import Agenda, make_agenda
from bench.checking import known
from bench.cores import simulator_threads, total_memory
from bench.costs import JOB_SECONDS
from bench.detectable import StudyPower, power_of
from bench.doing import say
from bench.isolation import apart
from bench.job_queue import Job, JobQueue, finishing_time, name_of
from bench.jobs import EvaluationJob, FitJob, jobs_of
from bench.machine import machine_factor, random_demos, warm_up
from bench.missing import find_missing
from bench.other_controllers import check_controllers
from bench.other_kernels import check_kernels
from bench.presets import Study
from bench.results import Results
from bench.spec import Fit
from bench.study_demos import demos_keys_of
from bench.trained import trained
from methods.base import Method, config_of, shortened
from methods.registry import SUITE, introduced
from tasks.errors import InputError, reason_of
from tasks.registry import get_task
from tasks.words import count_of

BYTES_PER_STEP = 4
"""Bytes that an episode stores for each control step: one reading."""
BYTES_PER_FIT = 5_000_000
"""Bytes of a stored fit, about those of the largest: K of 763 observables."""
GIB_PER_JOB = 1.5
"""Memory of a job with the largest fits, in GiB."""


@dataclass(frozen=True)
class Plan:
    """The cost of a study on this machine, and what it can show."""

    cells: int
    missing_controllers: int
    missing_fits: int
    missing_evaluations: int
    missing_episodes: int
    cpu_hours: float
    """Hours of one core."""
    wall_hours: float
    """Hours with the given number of parallel jobs."""
    longest_hours: float
    """Hours of the longest chain of jobs in which each needs the previous one: a lower bound."""
    memory_gib: float
    disk_gib: float
    free_gib: float
    power: StudyPower | None
    """What the seeds can show; None if it is not known."""

    def check(self) -> None:
        """Raises InputError if memory or disk does not suffice."""
        if self.disk_gib > self.free_gib:
            raise InputError(
                f"the results take about {self.disk_gib:.1f} GiB, but only {self.free_gib:.1f} GiB"
                " are free: choose fewer episodes, or another folder"
            )
        if self.memory_gib > total_memory():
            raise InputError(
                f"the jobs take about {self.memory_gib:.1f} GiB of memory, but this machine has"
                f" {total_memory():.1f}: choose fewer with --jobs"
            )


def make_plan(study: Study, folder: Path, jobs: int) -> Plan:
    """Returns the cost of a study, without the results that its folder already holds.

    Raises:
        InputError: `bench run` would refuse the study or the folder.
    """
    with introduced() as introduce:
        return _priced(_with_usable_methods(study, introduce), folder, jobs)


def _priced(study: Study, folder: Path, jobs: int) -> Plan:
    results = Results(folder)
    agenda = make_agenda(study, demos_keys_of(study), results)
    check_kernels(results)
    check_controllers(results, agenda.cells)
    queue = queue_of(agenda, results, jobs)
    say("measuring how fast this machine is")
    seconds = _prices(queue.waiting, machine_factor())
    kinds = Counter[str]()
    for job in queue.waiting:
        kinds[job.kind] += job.cost.count
    evaluations = [job for job in queue.waiting if isinstance(job, EvaluationJob)]
    size = BYTES_PER_FIT * kinds["fits"] + BYTES_PER_STEP * sum(
        job.episodes * get_task(job.cell.fit.task).horizon for job in evaluations
    )
    return Plan(
        cells=len(agenda.cells),
        missing_controllers=kinds["controllers"],
        missing_fits=kinds["fits"],
        missing_evaluations=len(evaluations),
        missing_episodes=sum(job.episodes for job in evaluations),
        cpu_hours=sum(seconds[name_of(job)] * _cores_of(job) for job in queue.waiting) / 3600,
        wall_hours=finishing_time(queue.waiting, jobs, lambda job: seconds[name_of(job)]) / 3600,
        longest_hours=queue.longest_chain(lambda job: seconds[name_of(job)]) / 3600,
        memory_gib=GIB_PER_JOB * jobs,
        disk_gib=size / 2**30,
        free_gib=free_disk(folder)[1],
        power=power_of(study),
    )


def queue_of(agenda: Agenda, results: Results, workers: int) -> JobQueue:
    """Returns the jobs of a run. Trained controllers and given weights need no job."""
    missing = find_missing(results, [cell.wanted for cell in agenda.cells])
    controllers = {spec.key: spec for cell in agenda.cells for spec in cell.controllers}
    ready = {key for key in missing.controllers if trained(controllers[key])}
    ready |= {cell.fit.key for cell in agenda.cells if cell.fit.weights}
    missing, threads = missing.without(ready), simulator_threads(workers)
    queue = JobQueue(jobs_of(agenda.known, missing, threads))
    for choice in agenda.choices:
        queue.add([choice, *jobs_of(choice.expected, missing, threads, choice.makes)])
    queue.divide_long(workers)
    return queue


def _cores_of(job: Job) -> int:
    return job.threads if isinstance(job, EvaluationJob) else 1


def _prices(jobs: Sequence[Job], factor: float) -> dict[str, float]:
    """The seconds of each job on this machine, by name."""
    prices = {name_of(job): factor * job.cost.seconds for job in jobs}
    fits = [job for job in jobs if isinstance(job, FitJob)]
    costs = blocks_seconds([job.fits for job in fits], [prices[name_of(job)] for job in fits])
    return prices | {name_of(job): cost for job, cost in zip(fits, costs, strict=True)}


def _with_usable_methods(study: Study, introduce: Callable[[type[Method]], None]) -> Study:
    unusable = []
    for name in guests(study.methods):
        try:
            introduce(known(name))
        except InputError as error:
            print(f"bench: {error}; it is left out", file=sys.stderr)
            unusable.append(name)
    return study.without(unusable)


def free_disk(folder: Path) -> tuple[Path, float]:
    """Returns the existing part of the path to a folder, and the free disk space there [GiB]."""
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    return there, shutil.disk_usage(there).free / 2**30


# Calibration
def blocks_seconds(blocks: Sequence[Sequence[Fit]], costs: Sequence[float]) -> list[float]:
    """Returns the seconds of each block of fits. Methods of packages are measured.

    Fits of a method that fails in the calibration are assumed to cost the mean of the other fits; a
    line on stderr says so.

    Args:
        blocks: the fits of each job.
        costs: seconds of each block, used for this suite's methods only.
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
    """Returns the CPU seconds of fits of a package's method that differ only in their seeds.

    The seconds are assumed proportional to demonstrations and epochs.
    """
    one = fits[0]
    say(f"measuring the cost of a fit of {one.method} ({one.size}) on {one.task}")
    unit = _unit_seconds(one.task, one.method, one.variant, one.size, len(fits))
    return JOB_SECONDS + unit * one.demos * float(one.config.get("epochs", 1))


@cache
def _unit_seconds(task_name: str, method: str, variant: str, size: str, seeds: int) -> float:
    """Seconds of the fits for each demonstration and epoch."""
    return float(apart(_measured, task_name, method, variant, size, seeds))


def _measured(task_name: str, method: str, variant: str, size: str, seeds: int) -> float:
    """The same, measured with 16 demonstrations and two epochs."""
    from methods.registry import get_method

    config = shortened(config_of(get_method(method, variant), size, variant), 2)
    epochs = getattr(config, "epochs", 1)
    training, validation = random_demos(task_name)
    layout = get_task(task_name).layout
    warm_up()
    began = process_time()
    several = [training] * seeds, [validation] * seeds
    fitted = get_method(method, variant).fit_seeds(config, layout, *several, range(1, seeds + 1))
    seconds = process_time() - began
    if len(fitted) != seeds:
        raise InputError(
            f"fit_seeds returned {count_of(len(fitted), 'method')} for {count_of(seeds, 'seed')}"
        )
    return seconds / (epochs * len(training))
