"""`bench status` and `doctor`: progress of a run, and checks of this machine."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.options import AsJson, results_folder
from tasks.words import count_of

if TYPE_CHECKING:
    from bench.results import Results


def status(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
    as_json: AsJson = False,
) -> None:
    """Show the progress of a study and its failures, during a run or after it."""
    from bench.clock import KINDS, counted, headline, running
    from bench.other_kernels import refusal
    from bench.remarks import remarks
    from bench.results import Results
    from bench.run_state import read_state

    results = Results(results_folder(folder))
    counts = progress(results)
    failures = results.failures()
    notes = [*remarks(results), *filter(None, [refusal(results)])]
    state = read_state(folder)
    if as_json:
        print(json.dumps(counts | {"failures": failures, "notes": notes, "run": state}))
        return
    if state:
        print(headline(state))
        print(f" {counted(state)}")
        if state["running"] and state["now"]:
            print(f" now: {running(state)}")
    for kind in KINDS:
        print(f"{kind + ':':<12} {counts[f'{kind}_done']} of {counts[kind]} done")
    if counts["missing_episodes"]:
        print(f"missing:     {counts['missing_episodes']:,} episodes")
    for note in notes:
        print(f"note: {note}")
    for failure in failures:
        tries = count_of(failure["tries"], "try", "tries")
        print(f"failed ({tries}): {failure['label']}: {failure['reason']}")


def progress(results: "Results") -> dict[str, int]:
    """Returns how many results the studies of a folder request, and how many are stored.

    The keys are ``controllers``, ``fits`` and ``evaluations``, each also with ``_done`` for the
    complete ones, and ``missing_episodes``.

    Raises:
        InputError: the folder holds no results.
    """
    from bench.missing import find_missing

    results.check_exists()
    wanted = results.manifest().wanted
    missing = find_missing(results, wanted)
    controllers = {name.key for one in wanted for name in one.controllers}
    fits = {one.fit.key for one in wanted if one.fitted}
    return {
        "controllers": len(controllers),
        "controllers_done": len(controllers - missing.controllers),
        "fits": len(fits),
        "fits_done": len(fits - missing.fits),
        "evaluations": len(wanted),
        "evaluations_done": len(wanted) - len(missing.evaluations),
        "missing_episodes": missing.episodes,
    }


def doctor(
    folder: Annotated[
        Path, typer.Argument(help="Planned results folder, which is checked for free disk space.")
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
