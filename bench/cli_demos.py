"""`bench demos`: make, record, import and export demonstrations."""

import sys
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.doing import doing, say
from bench.guest_tasks import known_task
from bench.options import SOME_FAILED, TaskName, number
from bench.parsing import known_names
from bench.parsing import seeds as parse_seeds
from tasks.disturbances import find_disturbances
from tasks.files import new_path
from tasks.registry import TASKS, task_names
from tasks.words import count_of

if TYPE_CHECKING:
    from tasks.arrays import Replayed
    from tasks.data import BoolArray

app = typer.Typer(
    no_args_is_help=True,
    help="Make the expert's demonstrations, record your own policy or import your own data, and"
    " exchange Minari data sets.",
)

Folder = Annotated[
    Path, typer.Argument(help="Folder of a Minari data set, the one that contains data/.")
]

NewFile = Annotated[
    Path, typer.Option(help="New file, such as mine.safetensors, for `bench run --demos`.")
]


@app.command()
def make(
    tasks: Annotated[
        list[str] | None,
        typer.Argument(help="Names of tasks, such as door tool. Default: the suite's."),
    ] = None,
    seeds: Annotated[
        str, typer.Option(help="Seeds to record for, such as 5 (1 to 5) or 2,4.")
    ] = "1",
) -> None:
    """Record the expert's demonstrations into the cache: 250 for each seed.

    200 of them are for training and 50 for validation.
    """
    from tasks.demos import demos_path, load_demos, split

    chosen = known_names("TASKS", "task", ",".join(tasks or TASKS), task_names())
    for name, seed in product(chosen, parse_seeds(seeds)):
        task = known_task(name)
        with doing(f"recording the expert's demonstrations of {name}, seed {seed}"):
            training, validation = map(len, split(load_demos(task, seed)))
        place = demos_path(task, seed)
        print(f"{name}: {training} + {validation} demonstrations in {place}", flush=True)


@app.command()
def disturb(
    task: TaskName,
    disturbance: Annotated[
        str,
        typer.Argument(
            help="Kinds and strengths, such as joints_off_0.05 or joints_off_0.05+late_1, see"
            " `bench describe disturbed`."
        ),
    ],
    out: NewFile,
    seed: Annotated[int, number(1, "Seed of the starts.")] = 1,
) -> None:
    """Record how the expert corrects: 250 demonstrations of disturbed episodes that succeed."""
    from tasks.demos import TRAINING, VALIDATION
    from tasks.demos_files import save_demos
    from tasks.experts import load_expert
    from tasks.recorder import make_demos

    chosen, wanted = known_task(task), TRAINING + VALIDATION
    find_disturbances(disturbance, chosen)
    new_path(out)
    with doing(f"recording the expert on {task} with {disturbance}"):
        demos = make_demos(
            chosen, load_expert(chosen).policy, wanted, seed, disturbance=disturbance
        )
    save_demos(demos, out)
    print(f"wrote {count_of(len(demos), 'demonstration')} to {out}")


@app.command("export")
def export_set(
    task: TaskName,
    folder: Annotated[Path, typer.Argument(help="New folder to write the data set to.")],
    seed: Annotated[int, number(1, "Seed of the demonstrations.")] = 1,
) -> None:
    """Write the expert's demonstrations of a task to a new folder, as a Minari data set."""
    from tasks.demos import load_demos
    from tasks.minari import export_demos

    chosen = known_task(task)
    new_path(folder)
    with doing(f"recording the expert's demonstrations of {task}"):
        demos = load_demos(chosen, seed)
        say(f"writing {count_of(len(demos), 'demonstration')}")
        export_demos(chosen, demos, folder)
    print(f"wrote {count_of(len(demos), 'demonstration')} of {task} to {folder}")


@app.command()
def record(
    task: TaskName,
    policy: Annotated[
        str,
        typer.Option(
            help="FILE.py:NAME, such as my_policy.py:act, or MODULE:NAME. A function act(state, t)"
            " from states (B, D) to actions (B, A), or a class or object with act and,"
            " optionally, reset."
        ),
    ],
    out: NewFile,
    count: Annotated[
        int, number(1, "Demonstrations to keep; four in five are for training.")
    ] = 250,
) -> None:
    """Run your own policy from new starts, and keep the episodes that succeed."""
    from bench.recording import record_policy
    from tasks.demos_files import save_demos

    known_task(task)
    new_path(out)
    success, demos = record_policy(
        task, policy, count, lambda line: print(line, file=sys.stderr, flush=True)
    )
    print(f"{task}: {policy} succeeds from {success.sum()} of {count_of(len(success), 'start')}")
    save_demos(demos, out)
    print(f"wrote {count_of(len(demos), 'demonstration')} to {out}")


@app.command("from-arrays")
def from_arrays(
    task: TaskName,
    file: Annotated[
        Path,
        typer.Argument(
            help=".npz file of arrays: actions (N, T-1, A), starts (N, P), and optionally states"
            " (N, T, D), compared with the replay."
        ),
    ],
    out: NewFile,
) -> None:
    """Replay recorded actions from their starts, and keep the episodes that succeed."""
    from tasks.arrays import read_arrays, replay_arrays

    chosen = known_task(task)
    new_path(out)
    _keep(task, replay_arrays(chosen, **read_arrays(file)), out)


@app.command("import")
def import_set(task: TaskName, folder: Folder, out: NewFile) -> None:
    """Replay a Minari data set of an Adroit environment, and keep the episodes that succeed."""
    from tasks.minari import import_demos

    chosen = known_task(task)
    new_path(out)
    with doing(f"replaying the episodes of {folder}"):
        imported = import_demos(chosen, folder)
    _keep(task, imported, out)


@app.command()
def verify(task: TaskName, folder: Folder) -> None:
    """Replay a Minari data set and show which episodes fail. Exit code 3 if any does."""
    from tasks.minari import import_demos

    with doing(f"replaying the episodes of {folder}"):
        success = import_demos(known_task(task), folder).success
    _print_replay(task, success)
    if not success.all():
        raise typer.Exit(SOME_FAILED)


def _print_replay(task: str, success: "BoolArray") -> None:
    failed = [str(episode) for episode in (~success).nonzero()[0]]
    print(f"{task}: {success.sum()} of {count_of(len(success), 'episode')} successful on replay")
    if failed:
        print(f"episodes that fail: {', '.join(failed)}")


def _keep(task: str, replayed: "Replayed", out: Path) -> None:
    """Prints the outcome of a replay, and writes the episodes that succeeded."""
    _print_replay(task, replayed.success)
    if replayed.drift is not None:
        print(f"the given states differ from the replay by at most {replayed.drift:.2g}")
    replayed.save(out)
    print(f"wrote {count_of(len(replayed.demos), 'demonstration')} to {out}")
