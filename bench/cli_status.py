"""`bench status` and `doctor`: the progress of a run, and the state of the machine."""

import json
from pathlib import Path
from typing import Annotated

import typer

from bench.options import AsJson, results_folder
from tasks.words import count_of


def status(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
    as_json: AsJson = False,
) -> None:
    """Show how much of a study is done, during a run or after it, and what failed."""
    from bench.clock import counted, headline, running
    from bench.remarks import remarks
    from bench.run_state import read_state
    from bench.store import Store

    store = Store(results_folder(folder))
    counts = store.progress()
    failures = store.failures()
    state = read_state(folder)
    if as_json:
        notes = {"failures": failures, "notes": remarks(store), "run": state}
        print(json.dumps(counts | notes))
        return
    if state:
        print(headline(state))
        for line in counted(state):
            print(f" {line}")
        if state["running"] and state["now"]:
            print(f" now: {running(state)}")
    for kind in ("controllers", "fits", "evaluations"):
        print(f"{kind + ':':<12} {counts[f'{kind}_done']} of {counts[kind]} done")
    for remark in remarks(store):
        print(f"note: {remark}")
    for failure in failures:
        tries = count_of(failure["tries"], "try", "tries")
        print(f"failed ({tries}): {failure['label']}: {failure['reason']}")


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
