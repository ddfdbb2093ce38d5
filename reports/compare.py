"""`bench compare`: pairs of methods on the same starts of the same seeds of each task."""

from collections.abc import Mapping, Sequence

import pandas as pd

from bench.doing import say
from bench.labels import labels_of
from bench.power import in_points
from reports.exhibit import MARK
from reports.pairing import keep_common
from reports.pairs import pairs_of
from reports.results import SPLITS, Results
from reports.seed_statistics import ONE_SEED
from reports.style import ordered
from tasks.errors import InputError
from tasks.registry import TASKS

HOW = (
    "p_holm: p after Holm's correction for all pairs of a task and split; up to 0.05, the methods"
    " are told apart.\n"
    "detectable: the smallest true difference that as many seeds find in 80% of studies, without"
    " correction.\n"
    "The expert of a task is fixed and outside every interval."
)
"""What a reader must know of the table."""
SINGLE = f"{MARK} One seed: interval and p speak of {ONE_SEED}."


def compare(results: Results, methods: Sequence[str]) -> pd.DataFrame:
    """Returns one row for each task, split and pair of methods, on common seeds and starts.

    Columns: ``task``, ``split``, and those of `reports.pairs.pairs_of`. Holm's correction is for
    the pairs of a task and split.

    Raises:
        InputError: there are fewer than two methods, a method has no results, or no two methods
            have a common seed.
    """
    labels = _labels(results, methods)
    if len(labels) < 2:
        raise InputError(f"two or more methods are compared, got {', '.join(labels)}")
    rows = compared_rows(results, labels)
    parts = []
    for task in ordered(rows.task, TASKS):
        for split in SPLITS:
            say(f"comparing {', '.join(labels)} on {task}, {split}")
            here = keep_common(rows[(rows.task == task) & (rows.split == split)])
            parts.append(pairs_of(results, here).assign(task=task, split=split))
    table = pd.concat([part for part in parts if len(part)] or parts[:1], ignore_index=True)
    if table.empty:
        raise InputError(f"{', '.join(labels)} have no seed in common on any task")
    return table[["task", "split", *table.columns.drop(["task", "split"])]]


def compared_rows(results: Results, methods: Sequence[str]) -> pd.DataFrame:
    """Returns the evaluations that `compare` compares."""
    parts = [
        results.rows.main(method=method, split=split, controller=_controller(results, method))
        for method in _labels(results, methods)
        for split in SPLITS
    ]
    return pd.concat(parts)


def as_text(table: pd.DataFrame, suffixes: Mapping[str, str]) -> str:
    """Returns a table of `compare` as people read it, with what they must know of it.

    Args:
        table: as `compare` returns it.
        suffixes: text after the name of a method, by method.
    """
    names = table[["left", "right"]].map(lambda name: name + suffixes.get(name, ""))
    single = table.basis == ONE_SEED
    shown = pd.DataFrame(
        {
            "task": table.task,
            "split": table.split,
            **names,
            "left [%]": table["left rate"].map("{:.1f}".format),
            "right [%]": table["right rate"].map("{:.1f}".format),
            "left - right [95%]": [
                f"{row.difference:+.1f} [{row.low:.1f}, {row.high:.1f}]{MARK * alone}"
                for row, alone in zip(table.itertuples(), single, strict=True)
            ],
            "p": table.p.map("{:.2g}".format),
            "p_holm": table.p_holm.map("{:.2g}".format),
            "detectable": table.detectable.map(in_points).replace("nan", "-"),
            "seeds": table.seeds,
            "starts of each": table.n,
        }
    )
    text = shown.to_markdown(index=False, disable_numparse=True)
    return "\n".join([text, *([SINGLE] if single.any() else []), HOW])


def _labels(results: Results, names: Sequence[str]) -> list[str]:
    """Returns the distinct labels that the names of methods stand for."""
    known = results.rows.methods()
    return list(dict.fromkeys(label for name in names for label in labels_of(name, known)))


def _controller(results: Results, method: str) -> str:
    controllers = results.rows.select(method=method).controller.unique()
    return "original" if "original" in controllers else "none"
