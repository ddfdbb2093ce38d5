"""`bench run`: compute what is missing of a study."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tasks.errors import InputError, unknown_name

if TYPE_CHECKING:
    pass

SOME_FAILED = 3
Names = Annotated[str | None, typer.Option(help="Comma-separated; all of the preset unless told.")]


def run(
    preset: Annotated[str, typer.Argument(help="smoke, quick or paper.")],
    out: Annotated[Path, typer.Option(help="Results folder; the same again goes on.")],
    experiments: Names = None,
    tasks: Names = None,
    methods: Names = None,
    sizes: Names = None,
    variants: Names = None,
    seeds: Annotated[str | None, typer.Option(help="A number of seeds, or 1,2,...")] = None,
    episodes: Annotated[int | None, typer.Option(help="Of each evaluation.")] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="METHOD.FIELD=VALUE of a config.")
    ] = None,
    jobs: Annotated[int | None, typer.Option(help="Processes at a time; one a core.")] = None,
) -> None:
    """Run a study; the same command again computes what is missing."""
    from bench.presets import get_preset
    from bench.run import run as run_study

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
        from methods.registry import method_names

        study = replace(study, methods=_names("method", methods, method_names()))
    if sizes is not None:
        study = replace(study, sizes=tuple(sizes.split(",")))
    if variants is not None:
        study = replace(study, variants=tuple(variants.split(",")))
    if seeds is not None:
        study = replace(study, seeds=_seeds(seeds))
    study = replace(study, settings=_settings(settings or []))
    outcome = run_study(study, out, None if jobs is None else _positive("jobs", jobs))
    for failure in outcome.failed:
        print(f"failed: {failure}", file=sys.stderr)
    print(f"{outcome.done} results computed, {outcome.cells} cells in {outcome.folder}")
    if outcome.failed:
        raise typer.Exit(SOME_FAILED)


def _names(kind: str, text: str, known: Any) -> tuple[str, ...]:
    names = tuple(text.split(","))
    for name in names:
        if name not in known:
            raise unknown_name(kind, name, known)
    return tuple(name for name in known if name in names)


def _positive(option: str, value: int) -> int:
    if value < 1:
        raise InputError(f"--{option} must be 1 or more, got {value}")
    return value


def _seeds(text: str) -> tuple[int, ...]:
    """``5`` means seeds 1 to 5, ``2,4`` those two and ``7,`` the seventh alone."""
    parts = [part for part in text.split(",") if part]
    if not parts or not all(part.isdecimal() and int(part) for part in parts):
        raise InputError(f"--seeds takes a number, or numbers from 1 like 1,2,3, got {text!r}")
    numbers = tuple(int(part) for part in parts)
    return numbers if "," in text else tuple(range(1, numbers[0] + 1))


def _settings(texts: list[str]) -> dict[tuple[str, str], Any]:
    import json

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
