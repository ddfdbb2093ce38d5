"""`bench failures`: which starts fail, and how."""

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench.options import AsJson, number, results_folder
from bench.parsing import known_names
from tasks.errors import InputError, unknown_name
from tasks.files import file_name, whole_file, writable_folder

if TYPE_CHECKING:
    import pandas as pd

    from reports.results import Results

FIRST = 5
"""Number of start indices in a row of the table."""


def failures(
    folder: Annotated[Path, typer.Argument(help="Folder of `bench run` or `bench pack`.")],
    method: Annotated[
        str | None,
        typer.Option(help="Comma-separated methods, one panel each. Default: all but the expert."),
    ] = None,
    task: Annotated[
        str | None, typer.Option(help="Name of a task, such as door. Default: all with results.")
    ] = None,
    split: Annotated[
        str | None,
        typer.Option(help="Split: test or ood (out of distribution). Default: both."),
    ] = None,
    seed: Annotated[int | None, number(0, "Seed of the fits. Default: all.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the pictures. Default: FOLDER/pictures.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show which starts fail and how, in a table and a picture for each task.

    Replays failed episodes to find how they failed. Packed results hold no fits,
    so they cannot be replayed.
    """
    import pandas as pd

    from bench.packed import is_packed
    from reports.results import Results

    results = Results(results_folder(folder, packed=True))
    place = writable_folder(out or folder / "pictures")
    tables, pictures = [], []
    for name in _tasks(results, task):
        by_method = _episodes(results, name, method, split, seed)
        tables.append(_count(name, by_method))
        chosen = [method, split, None if seed is None else f"s{seed}"]
        picture = file_name(["failures", name, *filter(None, chosen)])
        pictures.append(_draw(name, by_method, place / f"{picture}.png"))
    table = pd.concat(tables, ignore_index=True)
    films = [] if is_packed(folder) else _films(folder, table)
    if as_json:
        records = json.loads(table.to_json(orient="records"))
        facts = {"modes": records, "pictures": [str(path) for path in pictures], "films": films}
        print(json.dumps(facts))
        return
    print(_as_text(table))
    if is_packed(folder):
        print("packed results hold no fits, so how an episode failed is unknown")
    for path in pictures:
        print(path)
    for film in films:
        print(f"film: {film}")


def _tasks(results: "Results", task: str | None) -> list[str]:
    from reports.results import SPLITS
    from tasks.registry import get_task

    everywhere = results.frame.task.unique()
    there = [
        task for task in everywhere if any(results.rows.methods(task=task, split=s) for s in SPLITS)
    ]
    if task is None:
        return there
    get_task(task)
    if task not in there:
        raise unknown_name("task with results", task, there)
    return [task]


def _episodes(
    results: "Results", task: str, method: str | None, split: str | None, seed: int | None
) -> "dict[str, pd.DataFrame]":
    """Returns the episodes of each method on a task, on all its splits with results."""
    import pandas as pd

    from bench.labels import EXPERT
    from reports.failing import episodes
    from reports.results import SPLITS

    if split is not None and split not in SPLITS:
        raise unknown_name("split", split, SPLITS)
    splits = SPLITS if split is None else (split,)
    there = {one: results.rows.methods(task=task, split=one) for one in splits}
    known = list(dict.fromkeys(name for names in there.values() for name in names))
    if not known:
        raise InputError(f"{results.folder} holds no results of {task} on split {split!r}")
    learners = [name for name in known if name != EXPERT] or known
    chosen = known_names("--method", "method with results", method, known) if method else learners
    found = {}
    for name in chosen:
        parts = [
            episodes(results.folder, task, name, one, seed)
            for one, names in there.items()
            if name in names
        ]
        found[name] = pd.concat(parts, ignore_index=True)
    return found


def _count(task: str, by_method: "dict[str, pd.DataFrame]") -> "pd.DataFrame":
    """Returns how often each failure mode of each method occurs on a task."""
    import pandas as pd

    from reports.failing import count_modes
    from tasks.registry import get_task

    return pd.concat(
        count_modes(get_task(task), whole).assign(
            task=task, method=method, seeds=whole.seed.nunique()
        )
        for method, whole in by_method.items()
    )


def _draw(task: str, by_method: "dict[str, pd.DataFrame]", path: Path) -> Path:
    from reports.failing import draw_failures
    from reports.style import style
    from tasks.registry import get_task

    path.parent.mkdir(parents=True, exist_ok=True)
    with style(), whole_file(path) as file:
        draw_failures(get_task(task), by_method).savefig(file, format="png")
    return path


def _as_text(table: "pd.DataFrame") -> str:
    shown = table.assign(
        mode=table["mode"].fillna("-"),
        share=table.share.map("{:.1f}%".format),
        first_starts=[
            ", ".join(f"{seed}:{start}" for seed, start in starts[:FIRST])
            + ", ..." * (len(starts) > FIRST)
            for starts in table.starts
        ],
    )
    columns = ["task", "method", "split", "mode", "failed", "episodes", "share", "first_starts"]
    named = shown[columns].rename(columns={"first_starts": "first seed:start"})
    text: str = named.to_markdown(index=False, disable_numparse=True)
    return text if len(table) else "no episode failed"


def _films(folder: Path, table: "pd.DataFrame") -> list[str]:
    """Returns, for each task, the command that films the methods that fail from its first start."""
    failed = table[table.split == "test"]
    films = []
    for task, part in failed.groupby("task", sort=False):
        first = seed, start = min(part.starts.iloc[0])
        alike = part[[first in starts for starts in part.starts]]
        films.append(
            f"bench video {task} --results {shlex.quote(str(folder))}"
            f" --methods {shlex.quote(','.join(alike.method.unique()))}"
            f" --seed {seed} --start {start}"
        )
    return films
