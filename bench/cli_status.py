"""`bench status`, `verify` and `doctor`: how a run is getting on, and what machine it is on."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from bench.options import SOME_FAILED, AsJson


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


def verify(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
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

    found = verify_results(folder, cells, episodes, draw, Workers(jobs or default_jobs()))
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
