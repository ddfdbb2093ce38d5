"""`bench report`, `pack`, `compare`, `verify` and `video`: commands that show and check results."""

import json
import os
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated

import typer

from bench.doing import doing
from bench.options import (
    SOME_FAILED,
    AsJson,
    Jobs,
    TaskName,
    holds_results,
    number,
    results_folder,
)
from bench.parsing import names
from tasks.errors import InputError
from tasks.files import file_name, whole_file, writable_file, writable_folder
from tasks.registry import task_names, unknown_task
from tasks.words import count_of

if TYPE_CHECKING:
    from reports.results import Results

Stored = Annotated[
    Path | None,
    typer.Argument(help="Folder of `bench run` or `bench pack`. Give this or --reference."),
]
Reference = Annotated[
    bool, typer.Option("--reference", help="Use the shipped results instead of a folder.")
]
WithReference = Annotated[
    bool,
    typer.Option("--with-reference", help="Add the shipped results of methods not in the folder."),
]
Mixed = Annotated[
    bool,
    typer.Option(
        "--mixed",
        help="Also show results with different settings together, with a note of the differences.",
    ),
]


def report(
    folder: Stored = None,
    reference: Reference = False,
    with_reference: WithReference = False,
    mixed: Mixed = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the report. Default: FOLDER/report, or ./report with --reference."
        ),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(help="File for a table of all episodes, such as episodes.parquet."),
    ] = None,
    tables: Annotated[
        bool, typer.Option("--tables", help="Print all tables instead of the success table alone.")
    ] = False,
) -> None:
    """Write tables, figures and a web page (index.html).

    Exit code 3 if a table or figure cannot be made.
    """
    from bench.source import episodes_table
    from reports.answer import FIXED
    from reports.submitted_rows import SUBMITTED, Submitted, submitted_rows
    from reports.write import write_report

    source = _one_of(folder, reference)
    if out is not None and holds_results(out):
        raise InputError(f"{out} holds results: name another folder, such as {out / 'report'}")
    place = writable_folder(out or (Path("report") if folder is None else folder / "report"))
    if export is not None:
        writable_file(export)
    with _python_strings():
        results = _open(source, with_reference, mixed)
        if not reference:  # tests check the shipped results, and this would import torch
            for one in (results, *map(results.taught_by, results.experts[1:])):
                one.check_protocol(one.frame, mixed)
        with doing("writing the report"):
            submitted = submitted_rows(results, SUBMITTED) if reference else Submitted()
            made = write_report(results, place, source / "videos", submitted)
    if export is not None:
        with whole_file(export) as file:
            episodes_table(results.source).to_parquet(file, index=False)
    _print_notes(results)
    _print_tables(made.written, tables)
    tables_written = count_of(len(made.written), "table")
    print("\n".join([*made.answer, FIXED, "", f"wrote {tables_written} to {place.absolute()}"]))
    print(f"page: {made.page.absolute()}")
    if made.failed:
        raise typer.Exit(SOME_FAILED)


def _python_strings() -> AbstractContextManager[None]:
    """Has pandas keep strings as Python's: faster than Arrow's where few rows are picked often."""
    import pandas as pd

    return pd.option_context("mode.string_storage", "python")


def _print_tables(paths: Sequence[Path], all_of_them: bool) -> None:
    """Prints all tables, or that of success alone."""
    from reports.page import SUCCESS

    for path in paths:
        if all_of_them:
            print(path.read_text())
        elif path.stem == SUCCESS:
            title_and_rows, caption = path.read_text().rsplit("\n\n", 1)
            print(f"{title_and_rows}\n\n{fill(caption, 88)}\n")


def pack(
    folders: Annotated[
        list[Path], typer.Argument(help="Folders of `bench run` or `bench pack`, joined into one.")
    ],
    out: Annotated[Path, typer.Option(help="Folder of the packed results; made if needed.")],
) -> None:
    """Pack results into a few small files to share.

    Keeps what reports need, without weights.
    """
    from bench.packed import pack as pack_results

    for folder in folders:
        results_folder(folder, packed=True)
    with doing("packing"):
        pack_results(folders, writable_folder(out))
    size = sum(path.stat().st_size for path in out.iterdir())
    print(f"{size / 2**20:.1f} MiB in {out}; bench report {out} shows them")


def compare(
    methods: Annotated[
        str,
        typer.Option(
            help="Two or more comma-separated methods, such as kodex,nn or kodex,expert. A plain"
            " name, such as mine, selects all its labels, such as mine:hidden=64."
        ),
    ],
    folder: Stored = None,
    reference: Reference = False,
    with_reference: WithReference = False,
    mixed: Mixed = False,
    as_json: AsJson = False,
) -> None:
    """Compare methods seed by seed, on the same starts.

    Shows for each pair the difference, its 95% interval, p, p after Holm's correction, and
    the smallest difference that the seeds could have shown.
    """
    from reports.compare import as_text, compared_rows
    from reports.compare import compare as compare_methods

    chosen = names("--methods", methods)
    results = _open(_one_of(folder, reference), with_reference, mixed)
    if not reference:
        results.check_protocol(compared_rows(results, chosen), mixed)
    with doing(f"comparing {', '.join(chosen)}"):
        table = compare_methods(results, chosen)
    if as_json:
        print(table.to_json(orient="records"))
    else:
        print(as_text(table, results.suffixes))
    _print_notes(results, as_json)


def _open(source: Path, with_reference: bool, mixed: bool) -> "Results":
    """Opens results. Raises InputError if they come from several versions and are not mixed."""
    from reports.results import Results

    with doing("reading results"):
        results = Results(source, with_reference)
        if not mixed and not with_reference:
            results.check_versions()
    return results


def _print_notes(results: "Results", aside: bool = False) -> None:
    """Prints notes for the reader: to stderr if `aside`, since stdout holds JSON."""
    for note in results.notes:
        print(note, file=sys.stderr if aside else sys.stdout)


def verify(
    folder: Annotated[
        Path | None,
        typer.Argument(
            help="Folder of `bench run` or `bench pack`, or file of `bench submit`. Give this or"
            " --reference."
        ),
    ] = None,
    reference: Reference = False,
    cells: Annotated[
        int, number(1, "Number of stored evaluations to repeat, chosen at random.")
    ] = 3,
    episodes: Annotated[
        int | None,
        number(1, "Episodes to repeat of each evaluation, at most. Default: 500; of a file, all."),
    ] = None,
    draw: Annotated[
        int, number(0, "Seed of the random choice; another seed chooses other evaluations.")
    ] = 0,
    jobs: Jobs = None,
    as_json: AsJson = False,
) -> None:
    """Repeat some stored fits and evaluations, and compare them with the stored results.

    Exit code 3 if one differs too much: its success can be told from the stored one start
    by start, or any bit differs although kernels were pinned and versions are the same.
    A file of `bench submit` must be comparable with the shipped results, and its package
    installed with the same source.
    """
    from bench.backend import Workers
    from bench.cores import count_jobs
    from bench.packed import open_results
    from bench.parsing import LARGEST
    from bench.submission import Submission
    from bench.verify import APART, DIFFERENT, IDENTICAL
    from bench.verify import verify as verify_results
    from reports.submitting import check_submitted

    where = Workers(count_jobs(jobs))
    file = folder if folder and folder.is_file() and not reference else None
    with doing("reading results"):
        source = check_submitted(file) if file else open_results(_one_of(folder, reference))
        most = episodes or (LARGEST if file else 500)
        found = verify_results(source, cells, most, draw, where)
    if as_json:
        print(json.dumps([asdict(one) | {"verdict": one.verdict} for one in found]))
    else:
        for one in found:
            print(
                f"{one.verdict}: {one.fit} {one.evaluation}: {one.stored} of {one.episodes} stored,"
                f" {one.again} again, {count_of(one.differ, 'differing episode')}"
                f"{one.difference and f'; {one.difference}'}"
            )
        if isinstance(source, Submission) and all(one.verdict == IDENTICAL for one in found):
            print(f"sha256 of {folder}: {source.digest}")
    if any(one.verdict in (APART, DIFFERENT) for one in found):
        raise typer.Exit(SOME_FAILED)


def _one_of(folder: Path | None, reference: bool) -> Path:
    """Returns the results folder, or the folder of the shipped results."""
    from bench.packed import shipped

    if (folder is None) is not reference:
        both = "" if folder is None else ", not both"
        raise InputError(f"give a results folder or --reference (the shipped results){both}")
    return shipped() if folder is None else results_folder(folder, packed=True)


def video(
    task: TaskName,
    results: Annotated[Path, typer.Option(help="Results folder of `bench run`.")],
    methods: Annotated[
        str,
        typer.Option(help="Comma-separated methods, from left to right, such as kodex,expert."),
    ],
    start: Annotated[
        int | None,
        number(
            0,
            "Index of a test start of the seed. Default: one success and one failure of the first"
            " method.",
        ),
    ] = None,
    seed: Annotated[
        int | None, number(1, "Seed of the fits and starts. Default: the first method's lowest.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the films. Default: RESULTS/videos.")
    ] = None,
) -> None:
    """Film methods side by side from the same start.

    The predicted motion is drawn as a transparent hand.
    """
    from bench.guest_tasks import known_task
    from bench.renderer import renderer

    if task not in task_names():
        raise unknown_task(task)
    chosen = names("--methods", methods)
    results_folder(results)
    drawing = renderer()
    if drawing is None:
        raise InputError("this machine cannot draw: see `bench doctor`")
    os.environ["MUJOCO_GL"] = drawing
    known_task(task)  # imports MuJoCo
    from reports.video import film, lowest_seed, success_and_failure

    place = writable_folder(out or results / "videos")
    with doing("looking for starts to film"):
        seed = lowest_seed(results, task, chosen[0]) if seed is None else seed
        if start is None:
            starts = success_and_failure(results, task, chosen[0], seed)
        else:
            starts = {f"start-{start}": start}
    for name, index in starts.items():
        path = place / f"{file_name([task, *chosen, f's{seed}', name])}.mp4"
        with doing(f"filming {path.name}"):
            film(results, task, chosen, seed, index, path)
        print(path)
