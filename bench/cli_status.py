"""`bench status` and `doctor`: the progress of a run, and the state of the machine."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.options import AsJson, results_folder

if TYPE_CHECKING:
    from bench.results import Results


def status(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
    as_json: AsJson = False,
) -> None:
    """Show how much of a study is done, during a run or after it, and what failed."""
    from bench.clock import counted, headline, running
    from bench.remarks import remarks
    from bench.results import Results
    from bench.run_state import read_state

    results = Results(results_folder(folder))
    counts = progress(results)
    failures, notes = results.failures(), remarks(results)
    state = read_state(folder)
    if as_json:
        print(json.dumps(counts | {"failures": failures, "notes": notes, "run": state}))
        return
    if state:
        print(headline(state))
        for line in counted(state):
            print(f" {line}")
        if state["running"] and state["now"]:
            print(f" now: {running(state)}")
    for kind in ("controllers", "fits", "evaluations"):
        print(f"{kind + ':':<12} {counts[f'{kind}_done']} of {counts[kind]} done")
    for note in notes:
        print(f"note: {note}")
    for failure in failures:
        print("failed ({tries} tries): {label}: {reason}".format(**failure))


def progress(results: "Results") -> dict[str, int]:
    """Returns how many results studies have asked for, and how many are there in full.

    Of ``controllers``, ``fits`` and ``evaluations``, and of each those ``_done``.

    Raises:
        InputError: the manifest is damaged.
    """
    wanted = results.manifest().wanted
    controllers = {one.controller for one in wanted if one.controller}
    fits = {one.fit for one in wanted}
    return {
        "controllers": len(controllers),
        "controllers_done": sum(map(results.has_controller, controllers)),
        "fits": len(fits),
        "fits_done": sum(map(results.has_fit, fits)),
        "evaluations": len(wanted),
        "evaluations_done": sum(results.stored_episodes(one) >= one.episodes for one in wanted),
    }


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
