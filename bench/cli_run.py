"""`bench run`, `plan`, `time` and `merge`: compute the results of a study."""

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.options import SOME_FAILED, AsJson, Jobs, results_folder
from bench.study_options import takes_study
from tasks.errors import InputError
from tasks.files import writable_folder
from tasks.words import count_of

if TYPE_CHECKING:
    from bench.backend import Workers
    from bench.presets import Study
    from bench.runner import Outcome


@takes_study
def run(
    study: "Study",
    out: Annotated[Path, typer.Option(help="Results folder. Rerun the same command to resume.")],
    jobs: Jobs = None,
    backend: Annotated[
        str,
        typer.Option(help="Where jobs run: loky (this machine), dask or another joblib backend."),
    ] = "loky",
    scheduler: Annotated[
        str | None,
        typer.Option(
            help="Address of a dask scheduler, such as tls://host:8786; for --backend dask."
            " Default: dask workers on this machine."
        ),
    ] = None,
    limit: Annotated[
        float,
        typer.Option(
            help="Time limit of a job in minutes; a job that exceeds it is killed and counts as"
            " failed."
        ),
    ] = 720,
) -> None:
    """Run a study: fit methods and evaluate them. Only missing results are computed.

    The output counts cells: a cell is one fit, evaluated in one set of
    conditions.
    """
    from bench.backend import Workers
    from bench.cores import count_jobs

    _warn_of_namesakes(study.methods)
    count = count_jobs(jobs)
    if not 0 < limit < inf:
        raise InputError(f"--limit must be above 0, and finite, got {limit}")
    outcome = run_study(study, out, Workers(count, backend, scheduler, 60 * limit))
    print(
        f"{count_of(outcome.done, 'result')} computed, {count_of(outcome.cells, 'cell')} in {out}"
    )
    if outcome.failed:
        raise typer.Exit(SOME_FAILED)


def run_study(study: "Study", out: Path, where: "Workers") -> "Outcome":
    """Runs a study, see `bench.driver.run`. Prints failures, and how to resume a stopped run.

    Raises:
        typer.Exit: the results could not be written.
    """
    from bench.doing import doing
    from bench.driver import run as run_driver
    from bench.remarks import remarks
    from bench.results import Results

    try:
        with doing("checking the study"):
            outcome = run_driver(study, out, where)
    except OSError as error:
        print(
            f"bench: {error}; stored results are intact; rerun the same command to resume",
            file=sys.stderr,
        )
        raise typer.Exit(SOME_FAILED) from error
    except KeyboardInterrupt:
        print("stopped; rerun the same command to resume", file=sys.stderr)
        raise
    for remark in remarks(Results(out), study.methods):
        print(f"note: {remark}", file=sys.stderr)
    for failure in outcome.failed:
        print(f"failed: {failure}", file=sys.stderr)
    return outcome


def time(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
) -> None:
    """Measure the CPU time of stored fits, one at a time. Keep the machine otherwise idle."""
    from bench.doing import doing
    from bench.timing import time_fits

    with doing("looking for fits to time"):
        timed = time_fits(results_folder(folder), lambda line: print(line, flush=True))
    for failure in timed.failed:
        print(f"cannot be timed: {failure}", file=sys.stderr)
    print(f"{count_of(timed.done, 'fit')} timed in {folder}")
    if timed.failed:
        raise typer.Exit(SOME_FAILED)


@takes_study
def plan(
    study: "Study",
    out: Annotated[
        Path,
        typer.Option(
            help="Results folder of the run. Results already stored there are left out of the"
            " estimate."
        ),
    ],
    jobs: Jobs = None,
    as_json: AsJson = False,
) -> None:
    """Estimate time, memory and disk of a study on this machine, and what its seeds can show.

    Takes the options of `bench run`. The first call measures the machine's speed,
    in seconds. Methods of packages are measured on each call.
    """
    from bench.cores import count_jobs
    from bench.detectable import told
    from bench.doing import doing
    from bench.plan import make_plan

    if not out.is_dir():
        writable_folder(out)
    count = count_jobs(jobs)
    with doing("checking the study"):
        made = make_plan(study, out, count)
    if as_json:
        print(json.dumps(asdict(made)))
    else:
        missing = [
            count_of(getattr(made, f"missing_{noun}s"), noun)
            for noun in ("controller", "fit", "evaluation", "episode")
        ]
        print(
            f"{count_of(made.cells, 'cell')}; missing: {', '.join(missing[:3])} of {missing[3]}\n"
            "about {cpu_hours:.1f} CPU-hours, {wall_hours:.1f} hours with {jobs}"
            " and never below {longest_hours:.1f};"
            " {memory_gib:.1f} GiB of memory; {disk_gib:.2f} GiB of disk, {free_gib:.0f} free"
            "".format(**asdict(made), jobs=count_of(count, "job"))
        )
        print("\n".join(told(made.power)))
    made.check()


def _warn_of_namesakes(methods: Sequence[str]) -> None:
    from methods.registry import SUITE, unusable

    for name, fault in unusable().items():
        if name in SUITE and name in methods:
            print(f"bench: {fault}; the suite's own is used", file=sys.stderr)


def merge(
    folders: Annotated[list[Path], typer.Argument(help="Results folders of `bench run`.")],
    out: Annotated[Path, typer.Option(help="Results folder to merge into; made if needed.")],
) -> None:
    """Merge results folders into one, for example from several machines."""
    from bench.merge import merge as merge_folders

    for folder in folders:
        results_folder(folder)
    print(f"{count_of(merge_folders(folders, out), 'fit')} in {out}")
