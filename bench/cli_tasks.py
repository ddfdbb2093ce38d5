"""`bench check-task` and `bench new-task`: add a task of your own."""

from pathlib import Path
from typing import Annotated

import typer

from bench.options import AsJson, TaskName


def check_task(task: TaskName, as_json: AsJson = False) -> None:
    """Check a task against every rule. Exit code 3 if a rule is broken."""
    from bench.checked import end_with
    from bench.task_checking import ASKS, check_task_apart
    from tasks.checks import RULES

    end_with(check_task_apart(task), task, RULES, ASKS, as_json)


def new_task(
    name: Annotated[
        str,
        typer.Argument(
            help="Name of the new task: letters a-z, digits and _, beginning with a letter."
        ),
    ],
    folder: Annotated[Path, typer.Option(help="Parent folder of the new package.")] = Path(),
) -> None:
    """Write an installable package with a small working task, its model and its tests."""
    from bench.new_package import taken_names, write_package
    from tasks.names import check_new_name

    check_new_name("task", name, taken_names())
    target = folder / name
    write_package("tasks.template", name, target)
    print(
        f"wrote {target}: next, pip install -e {target} && bench check-task {name} && bench run"
        f" smoke --tasks {name} --out results/{name}"
    )
