"""`bench list` and `describe`: tasks, methods, experiments and presets."""

import json
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from bench.options import AsJson
from tasks.disturbances import UNDISTURBED, meaning_of
from tasks.registry import task_names, unusable_tasks
from tasks.words import count_of


def list_names(as_json: AsJson = False) -> None:
    """List the names of all tasks, methods, experiments and presets."""
    from bench.presets import PRESETS, experiment_names
    from methods.registry import method_names, unusable

    names = {
        "tasks": task_names(),
        "methods": method_names(),
        "experiments": experiment_names(),
        "presets": list(PRESETS),
    }
    if as_json:
        print(json.dumps(names))
        return
    for kind, known in names.items():
        print(f"{kind}: {', '.join(known)}")
    for fault in (*unusable_tasks().values(), *unusable().values()):
        print(f"unusable: {fault}")


def describe(
    name: Annotated[
        str,
        typer.Argument(
            help="Name of a task, method, experiment or preset, such as door, kodex, audit or"
            " paper; see `bench list`."
        ),
    ],
    as_json: AsJson = False,
) -> None:
    """Describe a task, a method, an experiment or a preset."""
    from bench.describe import describe as describe_name

    facts = describe_name(name)
    if as_json:
        print(json.dumps(facts))
        return
    printers = {
        "task": _print_task,
        "method": _print_method,
        "experiment": _print_experiment,
        "preset": _print_preset,
    }
    printers[facts["kind"]](facts)


def _print_task(facts: dict[str, Any]) -> None:
    print(f"{facts['name']}: {facts['summary']}")
    print(f"T = {facts['horizon']} states, 10 ms (one control step) apart")
    print("H = {robot_dim} joints, O = {object_dim}, A = {action_dim} actuators".format(**facts))
    print(f"success: {facts['success']}")
    print(f"model: {facts['model_file']}, SHA-256 {facts['model_hash']}\n")
    _print_table("state x = [x_r, x_o]", facts["components"])
    _print_table("what the success rule reads", [facts["reading"]])
    _print_table("starts, drawn uniformly", _start_rows(facts))
    title = "experts, success in per cent (docs/protocol.md)" if facts["experts"] else "no expert"
    _print_table(title, _expert_rows(facts))
    changes = facts["physics"].items()
    if len(changes) > 1:
        _print_table("physics", [{"name": name, **(change or {})} for name, change in changes])


def _print_method(facts: dict[str, Any]) -> None:
    print("{name}: {summary}, version {version}".format(**facts))
    how = "chooses by validation" if facts["validates"] else "does not use validation"
    print(f"predicts {facts['predicts']}; {how}")
    sizes = facts["sizes"]
    fields = list(next(iter(sizes.values())))
    rows = [
        {"field": field, **{size: str(sizes[size][field]) for size in sizes}} for field in fields
    ]
    _print_table("configs by size", rows)
    counts = facts["parameters"].items()
    _print_table(
        "numbers that a fit stores", [{"size": size, **by_task} for size, by_task in counts]
    )
    chosen = [{"task": task, "size": size} for task, size in facts["default_size"].items()]
    _print_table("default sizes", chosen)
    changes = facts["variants"].items()
    variants = [{"variant": name, "sets": json.dumps(values)} for name, values in changes]
    _print_table("variants", variants)


def _print_experiment(facts: dict[str, Any]) -> None:
    print(f"{facts['name']}: {facts['measures']}\nvaries: {facts['varies']}")
    for kind in ("physics", "success_rules"):
        print(f"{kind.replace('_', ' ')}: {', '.join(facts[kind])}")
    exhibits = facts["exhibits"]
    paper = [name.replace("_", " ").capitalize() for name in exhibits["paper"]]
    print(f"tables and figures of the paper: {', '.join(paper) or 'none'}")
    files = [*exhibits["paper"], *exhibits["own"]]
    print(f"files of `bench report` (report/tables/NAME.md): {', '.join(files)}\n")
    for kind in ("splits", "controllers"):
        named = facts[kind].items()
        _print_table(kind, [{"name": name, "meaning": meaning} for name, meaning in named])
    disturbed = [name for name in facts["disturbances"] if name != UNDISTURBED]
    if disturbed:
        _print_table("disturbances", [{"name": n, "meaning": meaning_of(n)} for n in disturbed])
    if facts["replans"] != [0]:
        print(f"control steps between predictions (0: one at the start): {facts['replans']}\n")
    columns = {
        "fits": "fits",
        "evaluations": "evaluations",
        "episodes": "episodes of each, at most",
        "episodes_in_all": "episodes in all",
    }
    rows = [
        {"preset": preset} | {column: f"{counts[name]:,}" for name, column in columns.items()}
        for preset, counts in facts["presets"].items()
        if counts
    ]
    _print_table("presets", rows)


def _print_preset(facts: dict[str, Any]) -> None:
    for name in ("tasks", "methods", "sizes", "seeds", "demos", "epochs_share"):
        value = facts[name]
        print(f"{name}: {', '.join(map(str, value)) if isinstance(value, list) else value}")
    print(facts["seed"])
    episodes = facts["episodes"].items()
    rows = [{"experiment": name, "episodes of each evaluation": count} for name, count in episodes]
    _print_table("experiments", rows)
    counts = {"fit": "fits", "evaluation": "evaluations", "episode": "episodes_in_all"}
    print(", ".join(count_of(facts[name], noun) for noun, name in counts.items()))
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


def _expert_rows(facts: dict[str, Any]) -> list[dict[str, str]]:
    rows = []
    for card in facts["experts"]:
        shares = {name: card[name] for name in ("probe", "ood", "tracked", "kodex")}
        faults, steps = card["faults"], card["steps"]
        judged = "missed" if faults else "kept"
        rows.append(
            {
                "name": card["name"],
                "seed": str(card["seed"] or ""),
                "steps": f"{steps / 1e6:.1f}M" if steps else "",
                **{name: "" if v is None else f"{100 * v:.1f}" for name, v in shares.items()},
                "rule": "not judged" if faults is None else judged,
            }
        )
    return rows


def _print_table(title: str, rows: list[dict[str, Any]]) -> None:
    table = Table(title=escape(title), title_justify="left")
    columns = list(dict.fromkeys(key for row in rows for key in row))
    for column in columns:
        # A name that is cut or broken cannot be copied.
        table.add_column(escape(column), no_wrap=column == columns[0], overflow="fold")
    for row in rows:
        cells = [row.get(column, "") for column in columns]
        table.add_row(*(escape(", ".join(c) if isinstance(c, tuple) else str(c)) for c in cells))
    Console().print(table)
