"""`bench submit`: packs the results of a package's method for the page of the shipped results."""

from pathlib import Path
from typing import Annotated

import typer

from bench.doing import doing
from bench.options import results_folder
from bench.parsing import known_names
from tasks.files import writable_file
from tasks.registry import TASKS
from tasks.words import count_of


def submit(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
    out: Annotated[Path, typer.Option(help="File of the row, such as mine.parquet.")],
    method: Annotated[
        str | None,
        typer.Option(help="Method of an installed package. Default: the only one in the folder."),
    ] = None,
    missing: Annotated[
        str | None,
        typer.Option(help="Comma-separated tasks that the row leaves out. Default: none."),
    ] = None,
) -> None:
    """Pack the results of your method as one row beside the shipped results.

    The row must be complete, and made with the same demonstrations, controllers,
    seeds and kernels; a difference is named. See docs/submit.md.
    """
    from reports.submitting import submit as submit_row

    left_out = known_names("--missing", "task", missing, TASKS) if missing else ()
    results_folder(folder)
    writable_file(out)
    with doing("packing the row"):
        row = submit_row(folder, method, left_out, out)
    package, rows = row.origin.package, row.frame()
    counts = count_of(len(rows), "evaluation"), count_of(int(rows.episodes.sum()), "episode")
    print(
        f"{row.label} of {package.name} {package.version}: {', '.join(counts)} in {out};"
        f" bench verify {out} repeats some"
    )
