"""`bench check` and `bench new-method`: add a method of your own."""

import json
from dataclasses import asdict
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated

import typer

from bench.doing import since_start
from bench.options import SOME_FAILED, AsJson
from tasks.files import whole_folder
from tasks.registry import TASKS
from tasks.words import count_of

if TYPE_CHECKING:
    from bench.checking import Checked


def check(
    method: Annotated[
        str, typer.Argument(help="Name of a method, such as kodex; see `bench list`.")
    ],
    as_json: AsJson = False,
) -> None:
    """Check a method against each rule of the method contract. Exit code 3 if it breaks one."""
    from bench.checking import check_apart

    checked = check_apart(method)
    if as_json:
        print(json.dumps([asdict(verdict) for verdict in checked.verdicts]))
    else:
        _show(method, checked, since_start())
    if not all(verdict.passed for verdict in checked.verdicts):
        raise typer.Exit(SOME_FAILED)


def _show(method: str, checked: "Checked", seconds: float) -> None:
    """Prints how many rules hold, what is broken, and which could not be tried for it."""
    from bench.checking import ANOTHER_PROCESS, ASKS
    from methods.checks import RULES

    asks = {name: rule.__doc__ for name, rule in RULES.items()} | {ANOTHER_PROCESS: ASKS}
    sound = [verdict.rule for verdict in checked.verdicts if verdict.passed]
    broken = [verdict for verdict in checked.verdicts if verdict.tried and not verdict.passed]
    untried = [verdict.message for verdict in checked.verdicts if not verdict.tried]
    print(f"{method}: {len(sound)} of {len(checked.verdicts)} rules hold, {seconds:.0f} s")
    for verdict in broken:
        print(f"BROKEN {verdict.rule}: {verdict.message}")
        if asks.get(verdict.rule):
            print(f"       the rule: {(asks[verdict.rule] or '').strip()}")
    for reason in dict.fromkeys(untried):
        print(f"       not tried: {count_of(untried.count(reason), 'rule')} ({reason})")
    if sound:
        print(fill(f"ok     {', '.join(sound)}", width=99, subsequent_indent=" " * 7))
    if checked.lines:
        print(f"It printed {count_of(checked.lines, 'line')}, which begin:")
        for line in checked.printed:
            print(f"       | {line}")


def new_method(
    name: Annotated[str, typer.Argument(help="Name of the new method, of a-z, 0-9 and _.")],
    folder: Annotated[
        Path, typer.Option(help="Folder in which the package's folder NAME is made.")
    ] = Path(),
) -> None:
    """Write an installable package with a small working method and its tests."""
    from importlib.resources import files

    from bench.presets import PRESETS
    from methods.names import check_new_name
    from methods.registry import method_names

    check_new_name(name, (*method_names(), *TASKS, *PRESETS["paper"].episodes, *PRESETS))
    target = folder / name
    class_name = "".join(part.capitalize() for part in name.split("_"))
    with whole_folder(target) as temporary:
        for source in files("methods.template").iterdir():
            if source.name.endswith(".txt"):
                text = source.read_text().replace("{{name}}", name).replace("{{Class}}", class_name)
                path = temporary / source.name.removesuffix(".txt").replace("NAME", name)
                path.write_text(text)
    print(
        f"wrote {target}: next, pip install -e {target} && bench check {name} && bench try {name}"
    )
