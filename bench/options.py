"""Options and exit codes that several commands share."""

from typing import Annotated

import typer

USAGE_ERROR, SOME_FAILED = 2, 3

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
TaskName = Annotated[str, typer.Argument(help="Name of a task, as `bench list` shows it.")]
