"""The command line, ``bench``."""

import io
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version
from typing import Annotated

import typer

from bench import (
    cli_demos,
    cli_describe,
    cli_expert,
    cli_methods,
    cli_run,
    cli_status,
    cli_tasks,
)
from bench.commands import add_commands
from bench.options import USAGE_ERROR
from tasks.errors import InputError
from tasks.pins import check_environment

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.add_typer(cli_expert.app, name="expert")
app.add_typer(cli_demos.app, name="demos")
app.command("list")(cli_describe.list_names)
app.command("describe")(cli_describe.describe)
app.command("run")(cli_run.run)
app.command("plan")(cli_run.plan)
app.command("time")(cli_run.time)
app.command("merge")(cli_run.merge)
app.command("status")(cli_status.status)
app.command("doctor")(cli_status.doctor)
app.command("check")(cli_methods.check)
app.command("new-method")(cli_methods.new_method)
app.command("check-task")(cli_tasks.check_task)
app.command("new-task")(cli_tasks.new_task)


add_commands(app)


def _print_version(asked: bool) -> None:
    if asked:
        print(f"kodex-bench {version('kodex-bench')}")
        raise typer.Exit


@app.callback()
def options(
    asked: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version and exit.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Compare imitation policies on four dexterous-hand tasks."""


EXTRAS = {
    "distributed": "dask",
    "h5py": "data",
    "imageio_ffmpeg": "video",
    "minari": "data",
    "stable_baselines3": "expert",
}
"""By optional module, the extra of this package that installs it."""


def main() -> None:
    """Runs the command line. Bad input and a missing extra end with exit code 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal may lack some characters
            stream.reconfigure(errors="backslashreplace")
    try:
        _check_folder()
        check_environment()
        _check_arguments(sys.argv[1:])
        app()
    except InputError as error:
        print(f"bench: {error}", file=sys.stderr)
        sys.exit(USAGE_ERROR)
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS:
            raise
        extra = EXTRAS[error.name]
        print(f"bench: {error}: pip install -e '.[{extra}]' in a clone", file=sys.stderr)
        sys.exit(USAGE_ERROR)


def _check_arguments(given: Sequence[str]) -> None:
    """Raises InputError if an argument is empty: as a path it would mean the current folder."""
    for before, text in zip(["bench", *given], given, strict=False):
        option, equals, value = text.partition("=")
        long = equals and option.startswith("--")
        if not (value if long else text):
            raise InputError(
                f"the text after {option if long else before} is empty: give a value; the current"
                " folder is written as ."
            )


def _check_folder() -> None:
    try:
        os.getcwd()
    except FileNotFoundError as error:
        raise InputError("the current folder has been removed: go to another one") from error
