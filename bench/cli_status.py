"""`bench status` and `doctor`: the progress of a run, and the state of the machine."""

import json
from pathlib import Path
from typing import Annotated

import typer

from bench.options import AsJson, results_folder


def status(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
    as_json: AsJson = False,
) -> None:
    """Show how much of a study is done, during a run or after it, and what failed."""
    from bench.remarks import remarks
    from bench.store import Store

    store = Store(results_folder(folder))
    counts = store.progress()
    failures = store.failures()
    if as_json:
        print(json.dumps(counts | {"failures": failures, "notes": remarks(store)}))
        return
    print("fits:        {fits_done} of {fits} done".format(**counts))
    print("evaluations: {evaluations_done} of {evaluations} done".format(**counts))
    for remark in remarks(store):
        print(f"note: {remark}")
    for failure in failures:
        print("failed ({tries} tries): {label}: {reason}".format(**failure))


def doctor(
    folder: Annotated[
        Path, typer.Argument(help="Folder to check for free disk space, where results would go.")
    ] = Path(),
    as_json: AsJson = False,
) -> None:
    """Check this machine: packages, cores, memory, disk, renderer, experts and demonstrations."""
    from bench.doctor import examine

    rows = examine(folder)
    if as_json:
        print(json.dumps(rows))
        return
    for row in rows:
        print("{what}: {found}".format(**row) + (f"  <- {row['advice']}" if row["advice"] else ""))
