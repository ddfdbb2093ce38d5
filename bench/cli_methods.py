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
    """Check every variant of a method against every rule. Exit code 3 if a rule is broken."""
    from bench.checking import check_apart

    checked = check_apart(method)
    if as_json:
        print(json.dumps([asdict(result) for result in checked.results]))
    else:
        _show(method, checked, since_start())
    if not all(result.passed for result in checked.results):
        raise typer.Exit(SOME_FAILED)


def _show(method: str, checked: "Checked", seconds: float) -> None:
    """Prints the number of rules that hold, the broken rules, and the rules not tried."""
    import pandas as pd

    from bench.checking import ANOTHER_PROCESS, ASKS
    from methods.checks import RULES

    asks = {name: rule.__doc__ for name, rule in RULES.items()} | {ANOTHER_PROCESS: ASKS}
    results = pd.DataFrame([asdict(result) for result in checked.results])
    variants = results.variant.nunique()
    held = results.groupby("rule", sort=False).passed.all()
    each = f" for each of {variants} variants" if variants > 1 else ""
    print(f"{method}: {held.sum()} of {len(held)} rules hold{each}, {seconds:.0f} s")
    broken = results[results.tried & ~results.passed]
    for (rule, message), rows in broken.groupby(["rule", "message"], sort=False):
        which = f" ({', '.join(rows.variant)})" if len(rows) < variants else ""
        print(f"BROKEN {rule}{which}: {message}")
        if asks.get(rule):
            print(f"       the rule: {(asks[rule] or '').strip()}")
    for reason, rows in results[~results.tried].groupby("message", sort=False):
        print(f"       not tried: {count_of(rows.rule.nunique(), 'rule')} ({reason})")
    if held.any():
        print(fill(f"ok     {', '.join(held.index[held])}", width=99, subsequent_indent=" " * 7))
    if checked.lines:
        print(f"It printed {count_of(checked.lines, 'line')}; the first are:")
        for line in checked.printed:
            print(f"       | {line}")


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
