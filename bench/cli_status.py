"""`bench status` and `doctor`: how a run is getting on, and what machine it is on."""

import json
from pathlib import Path
from typing import Annotated

import typer

from bench.options import AsJson


def status(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
    as_json: AsJson = False,
) -> None:
    """Say how much of a study is done, while it runs or after; from any shell."""
    from bench.store import Store

    store = Store(folder)
    counts = store.progress()
    failures = store.failures()
    if as_json:
        print(json.dumps(counts | {"failures": failures}))
        return
    print("fits:        {fits_done} of {fits} done".format(**counts))
    print("evaluations: {evaluations_done} of {evaluations} done".format(**counts))
    for failure in failures:
        print("failed ({tries} tries): {label}: {reason}".format(**failure))


def doctor(
    folder: Annotated[Path, typer.Argument(help="Where results would be written.")] = Path(),
    as_json: AsJson = False,
) -> None:
    """Say what this machine has, and what a run would miss."""
    from bench.doctor import examine

    rows = examine(folder)
    if as_json:
        print(json.dumps(rows))
        return
    for row in rows:
        print("{what}: {found}".format(**row) + (f"  <- {row['advice']}" if row["advice"] else ""))
