"""`bench check` and `bench new-method`: add a method of your own."""

from pathlib import Path
from typing import Annotated

import typer

from bench.options import AsJson


def check(
    method: Annotated[
        str, typer.Argument(help="Name of a method, such as kodex; see `bench list`.")
    ],
    as_json: AsJson = False,
) -> None:
    """Check every variant of a method against every rule. Exit code 3 if a rule is broken."""
    from bench.checked import end_with
    from bench.checking import ASKS, check_apart
    from methods.checks import RULES

    end_with(check_apart(method), method, RULES, ASKS, as_json)


def new_method(
    name: Annotated[
        str,
        typer.Argument(
            help="Name of the new method: letters a-z, digits and _, beginning with a letter."
        ),
    ],
    folder: Annotated[Path, typer.Option(help="Parent folder of the new package.")] = Path(),
) -> None:
    """Write an installable package with a small working method and its tests."""
    from bench.new_package import taken_names, write_package
    from tasks.names import check_new_name

    check_new_name("method", name, taken_names())
    target = folder / name
    write_package("methods.template", name, target)
    print(
        f"wrote {target}: next, pip install -e {target} && bench check {name} && bench try {name}"
    )
