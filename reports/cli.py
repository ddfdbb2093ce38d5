"""`bench report`, `pack`, `compare`, `verify` and `video`: what becomes of stored results."""

import json
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.options import SOME_FAILED, AsJson, TaskName
from tasks.errors import InputError
from tasks.files import whole_file, writable_file, writable_folder

if TYPE_CHECKING:
    from reports.results import Results

Beside = Annotated[
    bool, typer.Option("--with-reference", help="Shipped results of other methods beside them.")
]
Mixed = Annotated[
    bool, typer.Option("--mixed", help="Show results that cannot be compared, and say why.")
]


def report(
    folder: Annotated[
        Path | None, typer.Argument(help="Of `bench run` or `bench pack`; else --reference.")
    ] = None,
    reference: Annotated[bool, typer.Option("--reference", help="The shipped results.")] = False,
    with_reference: Beside = False,
    mixed: Mixed = False,
    out: Annotated[Path | None, typer.Option(help="Else FOLDER/report, or ./report.")] = None,
    export: Annotated[Path | None, typer.Option(help="Parquet file for all episodes.")] = None,
) -> None:
    """Write tables, figures and page of stored or shipped results; exit code 3 if one fails."""
    from bench.store import episodes_table
    from reports.results import Results
    from reports.write import write_report

    source = _one_of(folder, reference)
    place = writable_folder(out or (Path("report") if folder is None else folder / "report"))
    if export is not None:
        writable_file(export)
    results = Results(source, with_reference)
    if not mixed and not with_reference:
        results.check_versions()
    if not reference:  # tests check the shipped results, and this would import torch
        results.check_protocol(results.frame, mixed)
    made = write_report(results, place, source / "videos")
    for path in made.written:
        print(path.read_text())
    if export is not None:
        with whole_file(export) as file:
            episodes_table(results.source).to_parquet(file, index=False)
    _print_notes(results)
    print(f"{len(made.written)} exhibit(s) in {place}")
    if made.failed:
        raise typer.Exit(SOME_FAILED)


def pack(
    folders: Annotated[list[Path], typer.Argument(help="Of `bench run` or `bench pack`.")],
    out: Annotated[Path, typer.Option(help="Folder that gets the small form.")],
) -> None:
    """Write results in a small form to share: all that reports need, and no weights."""
    from reports.reference import pack as pack_results

    pack_results(folders, writable_folder(out))
    size = sum(path.stat().st_size for path in out.iterdir())
    print(f"{size / 2**20:.1f} MiB in {out}; bench report {out} shows them")


def compare(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
    methods: Annotated[str, typer.Option(help="Two or more, comma-separated.")],
    with_reference: Beside = False,
    mixed: Mixed = False,
    as_json: AsJson = False,
) -> None:
    """Compare methods on the same starts: difference, 95% interval, p, and q of false discovery."""
    from reports.compare import compare as compare_methods
    from reports.compare import compared
    from reports.results import Results

    results, names = Results(folder, with_reference), methods.split(",")
    if not mixed and not with_reference:
        results.check_versions()
    results.check_protocol(compared(results, names), mixed)
    table = compare_methods(results, names)
    if as_json:
        print(table.to_json(orient="records"))
    else:
        marked = {name: name + suffix for name, suffix in results.suffixes.items()}
        shown = table.assign(left=table.left.replace(marked), right=table.right.replace(marked))
        print(shown.to_markdown(index=False, floatfmt=".3g"))
    _print_notes(results, as_json)


def _print_notes(results: "Results", aside: bool = False) -> None:
    """Prints what a reader must know; to stderr, beside what programs read."""
    for note in results.notes:
        print(note, file=sys.stderr if aside else sys.stdout)


def verify(
    folder: Annotated[
        Path | None, typer.Argument(help="Of `bench run` or `bench pack`; else --reference.")
    ] = None,
    reference: Annotated[bool, typer.Option("--reference", help="The shipped results.")] = False,
    cells: Annotated[int, typer.Option(min=1, help="Evaluations, drawn at random.")] = 3,
    episodes: Annotated[int, typer.Option(min=1, help="Of each, at most.")] = 500,
    draw: Annotated[int, typer.Option(help="Another number draws others.")] = 0,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes at a time.")] = None,
    as_json: AsJson = False,
) -> None:
    """Fit and evaluate some of the stored results again; exit code 3 if they are other ones."""
    from bench.backend import Workers
    from bench.driver import default_jobs
    from bench.verify import OUTSIDE
    from bench.verify import verify as verify_results
    from reports.reference import open_results

    source = open_results(_one_of(folder, reference))
    found = verify_results(source, cells, episodes, draw, Workers(jobs or default_jobs()))
    if as_json:
        print(json.dumps([asdict(one) | {"verdict": one.verdict} for one in found]))
    else:
        for one in found:
            print(
                f"{one.verdict}: {one.fit} {one.evaluation}: {one.stored} of {one.episodes} stored,"
                f" {one.again} again, {one.differ} episodes differ"
            )
    if any(one.verdict == OUTSIDE for one in found):
        raise typer.Exit(SOME_FAILED)


def _one_of(folder: Path | None, reference: bool) -> Path:
    """The folder, or that of the shipped results."""
    from reports.reference import shipped

    if (folder is None) is not reference:
        raise InputError("this is about a results folder, or --reference: give one of them")
    return folder or shipped()


def video(
    task: TaskName,
    results: Annotated[Path, typer.Option(help="Results folder of `bench run`.")],
    methods: Annotated[str, typer.Option(help="Comma-separated, from left to right.")],
    start: Annotated[
        int | None, typer.Option(min=0, help="Of test; else a success and a failure of the first.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder; else RESULTS/videos.")] = None,
) -> None:
    """Film methods side by side from the same start, what each had planned as a ghost."""
    from bench.renderer import renderer

    drawing = renderer()
    if drawing is None:
        raise InputError("this machine cannot draw: see bench doctor")
    os.environ["MUJOCO_GL"] = drawing
    from reports.video import film, telling

    place = writable_folder(out or results / "videos")
    names = methods.split(",")
    starts = telling(results, task, names[0]) if start is None else {f"start-{start}": start}
    for name, index in starts.items():
        path = place / f"{task}-{name}.mp4"
        film(results, task, names, index, path)
        print(path)
