"""The command line, ``bench``."""

import io
import json
import os
import sys
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bench import cli_demos, cli_expert, cli_methods, cli_run, cli_status
from bench.commands import add_commands
from bench.options import USAGE_ERROR, AsJson
from tasks.errors import InputError
from tasks.registry import TASKS

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Compare imitation policies on four dexterous-hand tasks.",
)
app.add_typer(cli_expert.app, name="expert")
app.add_typer(cli_demos.app, name="demos")
app.command("run")(cli_run.run)
app.command("plan")(cli_run.plan)
app.command("time")(cli_run.time)
app.command("merge")(cli_run.merge)
app.command("status")(cli_status.status)
app.command("doctor")(cli_status.doctor)
app.command("check")(cli_methods.check)
app.command("new-method")(cli_methods.new_method)


@app.command("list")
def list_names(as_json: AsJson = False) -> None:
    """List the tasks, methods, experiments and presets there are."""
    from bench.presets import PRESETS
    from methods.registry import method_names

    names = {
        "tasks": list(TASKS),
        "methods": method_names(),
        "experiments": list(PRESETS["paper"].episodes),
        "presets": list(PRESETS),
    }
    if as_json:
        print(json.dumps(names))
        return
    for kind, known in names.items():
        print(f"{kind}: {', '.join(known)}")


@app.command()
def describe(
    name: Annotated[str, typer.Argument(help="A task, method or preset, see `bench list`.")],
    as_json: AsJson = False,
) -> None:
    """Show the particulars of a task, a method or a preset."""
    from bench.describe import describe as describe_name

    facts = describe_name(name)
    if as_json:
        print(json.dumps(facts))
        return
    {"task": _print_task, "method": _print_method, "preset": _print_preset}[facts["kind"]](facts)


add_commands(app)

EXTRAS = {
    "distributed": "dask",
    "h5py": "data",
    "imageio_ffmpeg": "video",
    "minari": "data",
    "stable_baselines3": "expert",
}
"""By module that not every installation has, the extra that brings it."""


def main() -> None:
    """Runs the command line; bad input, or an extra that is missing, ends with exit code 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal may not know every letter
            stream.reconfigure(errors="backslashreplace")
    try:
        _check_folder()
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


def _check_folder() -> None:
    try:
        os.getcwd()
    except FileNotFoundError as error:
        raise InputError("the current folder has been removed: go to another one") from error


def _print_task(facts: dict[str, Any]) -> None:
    print(f"{facts['name']}: {facts['summary']}")
    print(f"T = {facts['horizon']} states, a control step of 10 ms between two of them")
    print("H = {robot_dim} joints, O = {object_dim}, A = {action_dim} actuators".format(**facts))
    print(f"success: {facts['success']}")
    print(f"model: {facts['model_file']}, SHA-256 {facts['model_hash']}\n")
    _print_table("state x = [x_r, x_o]", facts["components"])
    _print_table("what the success rule reads", [facts["reading"]])
    _print_table("starts, drawn uniformly", _start_rows(facts))
    changes = facts["physics"].items()
    _print_table("physics", [{"name": name, **(change or {})} for name, change in changes])


def _print_method(facts: dict[str, Any]) -> None:
    print("{name}: {summary}, version {version}".format(**facts))
    seed = "" if facts["seeds"] else "; the seed changes nothing"
    print(f"predicts {facts['predicts']}{seed}")
    sizes = facts["sizes"]
    fields = list(next(iter(sizes.values())))
    rows = [
        {"field": field, **{size: str(sizes[size][field]) for size in sizes}} for field in fields
    ]
    _print_table("configs by size", rows)
    counts = facts["parameters"].items()
    _print_table("numbers stored of a fit", [{"size": size, **by_task} for size, by_task in counts])
    chosen = [{"task": task, "size": size} for task, size in facts["default_size"].items()]
    _print_table("default sizes", chosen)
    changes = facts["variants"].items()
    variants = [{"variant": name, "sets": json.dumps(values)} for name, values in changes]
    _print_table("variants", variants)


def _print_preset(facts: dict[str, Any]) -> None:
    for name in ("tasks", "methods", "sizes", "seeds", "demos", "epochs_share"):
        value = facts[name]
        print(f"{name}: {', '.join(map(str, value)) if isinstance(value, list) else value}")
    episodes = facts["episodes"].items()
    rows = [{"experiment": name, "episodes of each evaluation": count} for name, count in episodes]
    _print_table("experiments", rows)
    print("{fits} fits, {evaluations} evaluations, {episodes_in_all:,} episodes".format(**facts))
    print(f"{facts['note']} What it costs here: bench plan {facts['name']} --out DIR".strip())


def _start_rows(facts: dict[str, Any]) -> list[dict[str, str]]:
    rows = []
    for split, boxes in facts["splits"].items():
        for box in boxes:
            row = {"split": split}
            for start in facts["starts"]:
                low, high = box[start["name"]]
                row[f"{start['name']} [{start['unit']}]"] = f"{low:g} to {high:g}"
            rows.append(row)
    return rows


def _print_table(title: str, rows: list[dict[str, Any]]) -> None:
    table = Table(title=escape(title), title_justify="left")
    columns = list(dict.fromkeys(key for row in rows for key in row))
    for column in columns:
        table.add_column(escape(column))
    for row in rows:
        cells = [row.get(column, "") for column in columns]
        table.add_row(*(escape(", ".join(c) if isinstance(c, tuple) else str(c)) for c in cells))
    Console().print(table)
