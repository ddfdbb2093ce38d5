"""`bench run`: compute what is missing of a study."""

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from bench.options import SOME_FAILED, AsJson
from tasks.errors import InputError, unknown_name
from tasks.files import writable_folder

if TYPE_CHECKING:
    from bench.presets import Study

Number = TypeVar("Number", int, float)
Preset = Annotated[str, typer.Argument(help="smoke, quick or paper.")]
Seeds = Annotated[str | None, typer.Option(help="A number of seeds, or 1,2,...")]
Episodes = Annotated[int | None, typer.Option(help="Of each evaluation.")]
Settings = Annotated[
    list[str] | None, typer.Option("--set", help="METHOD.FIELD=VALUE of a config.")
]
DemosFile = Annotated[
    Path | None, typer.Option("--demos", help="File of `bench demos import`, of one task.")
]
Jobs = Annotated[int | None, typer.Option(help="Processes at a time; one a core.")]
Names = Annotated[str | None, typer.Option(help="Comma-separated; all of the preset unless told.")]


def run(
    preset: Preset,
    out: Annotated[Path, typer.Option(help="Results folder; the same again goes on.")],
    experiments: Names = None,
    tasks: Names = None,
    methods: Names = None,
    sizes: Names = None,
    variants: Names = None,
    seeds: Seeds = None,
    episodes: Episodes = None,
    demos: DemosFile = None,
    settings: Settings = None,
    jobs: Jobs = None,
    backend: Annotated[str, typer.Option(help="loky, dask or another of joblib's.")] = "loky",
    scheduler: Annotated[str | None, typer.Option(help="Address of a dask scheduler.")] = None,
    limit: Annotated[float, typer.Option(help="Minutes that a job may take.")] = 720,
) -> None:
    """Run a study; the same command again computes what is missing."""
    from bench.backend import Workers
    from bench.driver import default_jobs
    from bench.driver import run as run_study

    study = _study(
        preset, experiments, tasks, methods, sizes, variants, seeds, episodes, demos, settings
    )
    _warn_of_namesakes(study.methods)
    count = default_jobs() if jobs is None else _positive("jobs", jobs)
    if not 0 < limit < inf:
        raise InputError(f"--limit must be above 0, and finite, got {limit}")
    try:
        outcome = run_study(study, out, Workers(count, backend, scheduler, 60 * limit))
    except OSError as error:
        print(f"bench: {error}; what is stored is whole, the same command goes on", file=sys.stderr)
        raise typer.Exit(SOME_FAILED) from error
    except KeyboardInterrupt:
        print("stopped; the same command goes on", file=sys.stderr)
        raise
    for failure in outcome.failed:
        print(f"failed: {failure}", file=sys.stderr)
    print(f"{outcome.done} results computed, {outcome.cells} cells in {out}")
    if outcome.failed:
        raise typer.Exit(SOME_FAILED)


def time(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
) -> None:
    """Measure how long its fits take, one at a time; leave the machine alone meanwhile."""
    from bench.timing import time_fits

    timed = time_fits(folder, lambda line: print(line, flush=True))
    print(f"{timed} fits timed in {folder}")


def plan(
    preset: Preset,
    out: Annotated[Path, typer.Option(help="Results folder, which may hold some already.")],
    experiments: Names = None,
    tasks: Names = None,
    methods: Names = None,
    sizes: Names = None,
    variants: Names = None,
    seeds: Seeds = None,
    episodes: Episodes = None,
    demos: DemosFile = None,
    settings: Settings = None,
    jobs: Jobs = None,
    as_json: AsJson = False,
) -> None:
    """Say what a study will cost on this machine, after a short calibration."""
    from bench.driver import default_jobs
    from bench.plan import make_plan

    study = _study(
        preset, experiments, tasks, methods, sizes, variants, seeds, episodes, demos, settings
    )
    writable_folder(out)
    count = default_jobs() if jobs is None else _positive("jobs", jobs)
    made = make_plan(study, out, count)
    if as_json:
        print(json.dumps(asdict(made)))
    else:
        print(
            "{cells} cells; missing: {missing_controllers} controllers, {missing_fits} fits,"
            " {missing_evaluations} evaluations of {missing_episodes:,} episodes\n"
            "about {cpu_hours:.1f} CPU-hours, {wall_hours:.1f} hours with {jobs} jobs"
            " and never below {longest_hours:.1f};"
            " {memory_gib:.1f} GiB of memory; {disk_gib:.2f} GiB of disk, {free_gib:.0f} free"
            "".format(**asdict(made), jobs=count)
        )
    made.check()


def _study(
    preset: str,
    experiments: str | None,
    tasks: str | None,
    methods: str | None,
    sizes: str | None,
    variants: str | None,
    seeds: str | None,
    episodes: int | None,
    demos: Path | None,
    settings: list[str] | None,
) -> "Study":
    """The study that a command line asks for."""
    from bench.presets import get_preset

    study = get_preset(preset)
    if experiments is not None:
        chosen = _names("experiment", experiments, study.episodes)
        study = replace(study, episodes={name: study.episodes[name] for name in chosen})
    if episodes is not None:
        study = replace(
            study, episodes=dict.fromkeys(study.episodes, _positive("episodes", episodes))
        )
    if tasks is not None:
        from tasks.registry import TASKS

        study = replace(study, tasks=_names("task", tasks, TASKS))
    if methods is not None:
        from methods.registry import method_names, unusable

        known = dict.fromkeys([*method_names(), *unusable()])
        study = replace(study, methods=_names("method", methods, known))
    if sizes is not None:
        study = replace(study, sizes=tuple(sizes.split(",")))
    if variants is not None:
        study = replace(study, variants=tuple(variants.split(",")))
    if seeds is not None:
        study = replace(study, seeds=_seeds(seeds))
    if demos is not None:
        from bench.experiments import learning_from

        study = learning_from(study, demos)
    return replace(study, settings=_settings(settings or []))


def _warn_of_namesakes(methods: Sequence[str]) -> None:
    from methods.registry import SUITE, unusable

    for name, fault in unusable().items():
        if name in SUITE and name in methods:
            print(f"bench: {fault}; the suite's own is used", file=sys.stderr)


def _names(kind: str, text: str, known: Any) -> tuple[str, ...]:
    names = tuple(text.split(","))
    for name in names:
        if name not in known:
            raise unknown_name(kind, name, known)
    return tuple(name for name in known if name in names)


def _positive(option: str, value: Number) -> Number:
    if not 1 <= value < inf:  # nor is NaN
        raise InputError(f"--{option} must be 1 or more, and finite, got {value}")
    return value


def _seeds(text: str) -> tuple[int, ...]:
    """``5`` means seeds 1 to 5, ``2,4`` those two and ``7,`` the seventh alone."""
    parts = [part for part in text.split(",") if part]
    if not parts or not all(part.isdecimal() and int(part) for part in parts):
        raise InputError(f"--seeds takes a number, or numbers from 1 like 1,2,3, got {text!r}")
    numbers = tuple(int(part) for part in parts)
    return numbers if "," in text else tuple(range(1, numbers[0] + 1))


def _settings(texts: list[str]) -> dict[tuple[str, str], Any]:
    settings = {}
    for text in texts:
        place, equals, value = text.partition("=")
        method, dot, field = place.partition(".")
        if not (equals and dot and method and field):
            raise InputError(f"--set takes METHOD.FIELD=VALUE, got {text!r}")
        try:
            settings[method, field] = json.loads(value)
        except ValueError:
            settings[method, field] = value
    return settings


def merge(
    folders: Annotated[list[Path], typer.Argument(help="Results folders of `bench run`.")],
    out: Annotated[Path, typer.Option(help="Results folder that gets everything.")],
) -> None:
    """Merge results folders, as from several machines, into one."""
    from bench.merge import merge as merge_folders

    print(f"{merge_folders(folders, out)} fits in {out}")
