"""`bench check` and `bench new-method`: add a method of your own."""

import json
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from bench.options import SOME_FAILED, AsJson
from tasks.files import whole_folder
from tasks.registry import TASKS


def check(
    method: Annotated[
        str, typer.Argument(help="Name of a method, such as kodex; see `bench list`.")
    ],
    as_json: AsJson = False,
) -> None:
    """Check a method against each rule of the method contract. Exit code 3 if it breaks one."""
    from bench.checking import ANOTHER_PROCESS, ASKS, check_apart
    from methods.checks import RULES

    began = perf_counter()
    verdicts = check_apart(method)
    if as_json:
        print(json.dumps([asdict(verdict) for verdict in verdicts]))
    else:
        asks = {name: rule.__doc__ for name, rule in RULES.items()} | {ANOTHER_PROCESS: ASKS}
        tried = [verdict for verdict in verdicts if verdict.tried]
        for verdict in tried:
            mark = "ok" if verdict.passed else "BROKEN"
            print(
                f"{mark:7}{verdict.rule}: {verdict.message or (asks[verdict.rule] or '').strip()}"
            )
        if len(tried) < len(verdicts):
            print(f"{len(verdicts) - len(tried)} rules need what is broken and were not tried")
        kept = sum(verdict.passed for verdict in verdicts)
        seconds = perf_counter() - began
        print(f"{method}: {kept} of {len(verdicts)} rules hold, {seconds:.0f} s")
    if not all(verdict.passed for verdict in verdicts):
        raise typer.Exit(SOME_FAILED)


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
