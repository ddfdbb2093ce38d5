"""`bench check` and `bench new-method`: bring a method of one's own."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from bench.options import SOME_FAILED, AsJson
from tasks.files import whole_folder
from tasks.registry import TASKS


def check(
    method: Annotated[str, typer.Argument(help="Name of a method, as `bench list` shows it.")],
    as_json: AsJson = False,
) -> None:
    """Say rule by rule whether a method keeps the contract; exit code 3 unless it does."""
    from methods.checks import RULES
    from methods.checks import check as check_method
    from methods.registry import get_method

    verdicts = []
    for verdict in check_method(get_method(method)):
        verdicts.append(verdict)
        if not as_json:
            mark = "ok" if verdict.passed else "BROKEN"
            says = (RULES[verdict.rule].__doc__ or "").strip()
            print(f"{mark:7}{verdict.rule}: {verdict.message or says}", flush=True)
    if as_json:
        print(json.dumps([asdict(verdict) for verdict in verdicts]))
    if not all(verdict.passed for verdict in verdicts):
        raise typer.Exit(SOME_FAILED)


def new_method(
    name: Annotated[str, typer.Argument(help="Name of the method: a-z, 0-9 and _.")],
    folder: Annotated[Path, typer.Option(help="Where the package's folder is put.")] = Path(),
) -> None:
    """Write a package with a small working method, its tests and what installs it."""
    from importlib.resources import files

    from bench.presets import PRESETS
    from methods.names import check_new_name
    from methods.registry import method_names

    check_new_name(name, (*method_names(), *TASKS, *PRESETS))
    target = folder / name
    class_name = "".join(part.capitalize() for part in name.split("_"))
    with whole_folder(target) as temporary:
        for source in files("methods.template").iterdir():
            if source.name.endswith(".txt"):
                text = source.read_text().replace("{{name}}", name).replace("{{Class}}", class_name)
                path = temporary / source.name.removesuffix(".txt").replace("NAME", name)
                path.write_text(text)
    print(f"wrote {target}: next, pip install -e {target} && bench check {name}")
