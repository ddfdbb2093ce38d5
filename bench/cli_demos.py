"""`bench demos`: the demonstrations that methods learn from."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.doing import doing, say
from bench.options import SOME_FAILED, TaskName
from bench.parsing import known_names
from tasks.errors import InputError
from tasks.files import new_path
from tasks.registry import TASKS, get_task

if TYPE_CHECKING:
    from tasks.data import BoolArray

app = typer.Typer(
    no_args_is_help=True, help="Make demonstrations, and exchange them as Minari data sets."
)

Folder = Annotated[
    Path, typer.Argument(help="Folder of a Minari data set, the one that contains data/.")
]


@app.command()
def make(
    tasks: Annotated[
        list[str] | None, typer.Argument(help="Names of tasks, such as door tool. Default: all.")
    ] = None,
) -> None:
    """Record the expert's demonstrations, 200 to train on and 50 to validate, into the cache."""
    from tasks.demos import demos_path, load_demos, split

    for name in known_names("TASKS", "task", ",".join(tasks or TASKS), TASKS):
        task = get_task(name)
        with doing(f"recording the expert's demonstrations of {name}"):
            training, validation = map(len, split(load_demos(task)))
        print(f"{name}: {training} + {validation} demonstrations in {demos_path(task)}", flush=True)


@app.command("export")
def export_set(task: TaskName, folder: Folder) -> None:
    """Write the expert's demonstrations of a task as a Minari data set, into a new folder."""
    from tasks.demos import load_demos
    from tasks.minari import export_demos

    chosen = get_task(task)
    new_path(folder)
    with doing(f"recording the expert's demonstrations of {task}"):
        demos = load_demos(chosen)
        say(f"writing {len(demos)} demonstrations")
        export_demos(chosen, demos, folder)
    print(f"wrote {len(demos)} demonstrations of {task} to {folder}")


@app.command("import")
def import_set(
    task: TaskName,
    folder: Folder,
    out: Annotated[
        Path, typer.Option(help="New file, such as mine.safetensors, for `bench run --demos`.")
    ],
) -> None:
    """Replay a Minari data set of an Adroit environment and keep the episodes that succeed."""
    from tasks.demos import save_demos
    from tasks.minari import import_demos

    new_path(out)
    with doing(f"replaying the episodes of {folder}"):
        imported = import_demos(get_task(task), folder)
    _print_replay(task, imported.success)
    if not len(imported.demos):
        raise InputError(f"no episode of {folder} succeeds on replay, so there is nothing to write")
    save_demos(imported.demos, out)
    print(f"wrote {len(imported.demos)} demonstrations to {out}")


@app.command()
def verify(task: TaskName, folder: Folder) -> None:
    """Replay a Minari data set and show which episodes fail. Exit code 3 if any does."""
    from tasks.minari import import_demos

    with doing(f"replaying the episodes of {folder}"):
        success = import_demos(get_task(task), folder).success
    _print_replay(task, success)
    if not success.all():
        raise typer.Exit(SOME_FAILED)


def _print_replay(task: str, success: "BoolArray") -> None:
    failed = [str(episode) for episode in (~success).nonzero()[0]]
    print(f"{task}: {success.sum()} of {len(success)} episodes succeed on replay")
    if failed:
        print(f"episodes that fail: {', '.join(failed)}")
