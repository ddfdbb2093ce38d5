"""`bench try`: fits one method on one task and compares it with the shipped methods."""

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bench import parsing
from bench.cli_run import run_study
from bench.doing import since_start
from bench.options import SOME_FAILED, AsJson, number
from bench.studies import study_of
from bench.study_options import Settings, Weights
from tasks.registry import task_names, unusable_tasks
from tasks.words import count_of

if TYPE_CHECKING:
    import pandas as pd

    from reports.trial import Trial


def try_method(
    method: Annotated[str, typer.Argument(help="Name of a method, such as nn; see `bench list`.")],
    task: Annotated[str, typer.Option(help="Name of a task, such as tool.")] = "door",
    seed: Annotated[int, number(1, "Seed of the demonstrations, starts and random numbers.")] = 1,
    episodes: Annotated[
        int, number(1, "Number of episodes, one from each of the first test starts.")
    ] = 200,
    settings: Settings = None,
    weights: Weights = None,
    out: Annotated[
        Path, typer.Option(help="Results folder. Rerun the same command to resume.")
    ] = Path("results/try"),
    as_json: AsJson = False,
) -> None:
    """Fit a method on one task and compare it with the shipped methods.

    The method learns from 200 demonstrations at its default size. Exit code 3 if
    the fit or evaluation fails.
    """
    from bench.backend import Workers
    from methods.registry import method_names, unusable

    known = dict.fromkeys([*method_names(), *unusable()])
    (chosen,) = parsing.known_names("METHOD", "method", method, known)
    known = dict.fromkeys([*task_names(), *unusable_tasks()])
    (place,) = parsing.known_names("--task", "task", task, known)
    from reports.trial import trial_of

    study = study_of(
        "paper",
        experiments="success",
        tasks=place,
        methods=chosen,
        seeds=(seed,),
        episodes=episodes,
        settings=settings,
        weights=weights,
    )
    if run_study(study, out, Workers(1)).failed:
        raise typer.Exit(SOME_FAILED)
    trial = trial_of(study, out)
    seconds = since_start()
    from bench.packed import shipped
    from reports.results import Results

    reference = Results(shipped())
    others, unlike = trial.compare(reference), trial.differing_settings(reference)
    if as_json:
        print(json.dumps(_as_json(trial, others, unlike) | {"seconds": seconds}))
        return
    print(_heading(trial).ljust(80) + f"{seconds:6.0f} s")
    print(_table(trial, others))
    print(_remark(trial, others, unlike))
    print(_next_commands(trial, out))


def _as_json(trial: "Trial", others: "pd.DataFrame", unlike: "pd.DataFrame") -> dict[str, Any]:
    fit = trial.cell.fit
    return {
        "task": fit.task,
        "size": fit.size,
        "demos": fit.demos,
        "weights": fit.weights,
        "seed": fit.seed,
        **trial.rate,
        "failures": trial.failures,
        "diverged": trial.diverged,
        "shipped": others.to_dict("records"),
        "unlike": unlike.to_dict("records"),
    }


def _heading(trial: "Trial") -> str:
    fit = trial.cell.fit
    name = fit.method if fit.size == "single" else f"{fit.method} {fit.size}"
    learnt = "weights from a file" if fit.weights else count_of(fit.demos, "demo")
    starts = f"first {count_of(len(trial.success), 'start')} of test"
    return " · ".join([f"{name} on {fit.task}", learnt, f"seed {fit.seed}", starts])


def _table(trial: "Trial", others: "pd.DataFrame") -> str:
    import pandas as pd

    from reports.style import display

    name = trial.cell.fit.method
    row = f"{name}, weights from a file" if trial.cell.fit.weights else name
    table = pd.DataFrame({"": [row], "success [%]": [_rate(trial.rate)]})
    if others.empty:
        return _indented(table)
    rows = others.to_dict("records")
    shipped = {
        "": others.method.map(display),
        "success [%]": list(map(_rate, rows)),
        f"{name} minus it": list(map(_difference, rows)),
    }
    return _indented(pd.concat([table, pd.DataFrame(shipped)]).fillna(""))


def _indented(table: "pd.DataFrame") -> str:
    text: str = table.to_markdown(index=False, tablefmt="plain", disable_numparse=True)
    return "\n".join(f"  {line}" for line in text.splitlines())


def _rate(row: dict[str, Any]) -> str:
    return "{success:5.1f} [{low:.1f}, {high:.1f}]".format(**row)


def _difference(row: dict[str, Any]) -> str:
    return "{difference:+6.1f} [{difference_low:.1f}, {difference_high:.1f}]".format(**row)


def _remark(trial: "Trial", others: "pd.DataFrame", unlike: "pd.DataFrame") -> str:
    """Returns what a reader must know of the comparison with the shipped methods."""
    if len(unlike):
        heading = "The shipped methods were run otherwise and are left out:"
        return f"{heading}\n{_indented(unlike)}"
    if others.empty:
        return f"No results of other methods on {trial.cell.fit.task} are shipped."
    fewest = others.n.min()
    few = f", on the first {count_of(fewest, 'start')}" if fewest < len(trial.success) else ""
    from methods.registry import CLOSED_LOOP
    from reports.seed_statistics import ONE_SEED
    from reports.style import display

    alike = ["demos"] * (not trial.cell.fit.weights) + ["controller"] * bool(trial.cell.controller)
    same = " and ".join(filter(None, [", ".join(alike), "starts"]))
    remark = (
        f"The others are shipped results: same {same}{few}. Brackets: 95% intervals of {ONE_SEED}."
    )
    if trial.cell.controller:
        return remark
    name = trial.cell.fit.method
    seeing = [
        name,
        *map(display, [one for one in CLOSED_LOOP if one in set(others.method) - {name}]),
    ]
    seen = f"States on the way are seen by {', '.join(seeing)}; the others see the first one."
    return f"{remark}\n{seen}"


def _next_commands(trial: "Trial", out: Path) -> str:
    from bench.labels import labelled
    from bench.names import folder_name
    from bench.results import Results

    fit, failed, folder = trial.cell.fit, trial.failures, shlex.quote(str(out))
    rows = labelled(Results(out).frame())
    name = rows[rows.folder == folder_name(fit.label, fit.key)].method.iloc[0]
    start = (failed or [0])[0]
    film = f"bench video {fit.task} --results {folder} --methods {name}"
    film += f" --seed {fit.seed} --start {start}"
    if not failed:
        return f"none failed; film of one: {film}"
    shown = f"bench failures {folder} --method {name} --task {fit.task} --seed {fit.seed}"
    if len(failed) == len(trial.success) and trial.cell.controller:
        film += f"\nits motion, tracked and demonstrated, in Python: bench.open({str(out)!r})"
        film += f".plot_motion({fit.task!r}, {name!r}, 0)"
    diverged = f" ({trial.diverged} diverged)" if trial.diverged else ""
    return f"{len(failed)} failed{diverged}: {shown}\nfilm of the first: {film}"
