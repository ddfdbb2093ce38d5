"""`bench demos`: the demonstrations that methods learn from."""

from typing import Annotated

import typer

from tasks.registry import TASKS, get_task

app = typer.Typer(no_args_is_help=True, help="Make the demonstrations.")


@app.callback()
def demos() -> None:
    """Make the demonstrations."""


@app.command()
def make(
    tasks: Annotated[list[str] | None, typer.Argument(help="Tasks; all unless told.")] = None,
) -> None:
    """Make 200 + 50 demonstrations a task, unless the cache has them."""
    from tasks.demos import TRAINING, demos_path, load_demos

    for name in tasks or TASKS:
        task = get_task(name)
        count = len(load_demos(task))
        held_out = count - TRAINING
        print(f"{name}: {TRAINING} + {held_out} demonstrations in {demos_path(task)}", flush=True)
