"""`bench compare`: two or more methods on the same starts, task by task."""

from collections.abc import Sequence
from itertools import combinations

import pandas as pd
from scipy.stats import false_discovery_control

from bench.doing import say
from reports.results import Results
from reports.stats import paired_difference
from reports.style import TASKS
from tasks.data import BoolArray
from tasks.errors import InputError, unknown_name

SPLITS = ("test", "ood")


def compare(results: Results, methods: Sequence[str]) -> pd.DataFrame:
    """Returns one row for each task, split and pair of methods, on the starts that both have met.

    Columns: ``task``, ``split``, ``left``, ``right``; success of both and its ``difference`` with
    the 95% interval ``low`` to ``high``, in per cent and points; ``p`` and ``q``, the same after
    control of the false discovery rate over all rows (Benjamini and Hochberg); ``n`` starts.

    Raises:
        InputError: fewer than two methods, one of which there are no results, or no common starts.
    """
    known = list(results.select().method.unique())
    for method in methods:
        if method not in known:
            raise unknown_name("method with results", method, known)
    if len(set(methods)) < 2:
        raise InputError(f"two or more methods are compared, got {', '.join(methods)}")
    rows = []
    for task in TASKS:
        for split in SPLITS:
            say(f"comparing {', '.join(methods)} on {task}, {split}")
            found = {m: _success(results, m, task, split) for m in dict.fromkeys(methods)}
            outcomes = {m: success for m, success in found.items() if success is not None}
            rows += [
                {"task": task, "split": split, "left": left, "right": right}
                | _difference(outcomes[left], outcomes[right], f"{task} {split} {left} {right}")
                for left, right in combinations(outcomes, 2)
            ]
    if not rows:
        raise InputError(f"{', '.join(methods)} have met no starts in common")
    table = pd.DataFrame(rows)
    return table.assign(q=false_discovery_control(table.p))


def compared(results: Results, methods: Sequence[str]) -> pd.DataFrame:
    """Returns the evaluations of methods that `compare` lays beside each other."""
    parts = [
        results.main(method=method, split=split, controller=_controller(results, method))
        for method in dict.fromkeys(methods)
        for split in SPLITS
    ]
    return pd.concat(parts)


def _controller(results: Results, method: str) -> str:
    controllers = results.select(method=method).controller.unique()
    return "original" if "original" in controllers else "none"


def _success(results: Results, method: str, task: str, split: str) -> BoolArray | None:
    controller = _controller(results, method)
    return results.success(method=method, task=task, split=split, controller=controller)


def _difference(left: BoolArray, right: BoolArray, name: str) -> dict[str, float]:
    starts = min(left.shape[1], right.shape[1])
    left, right = left[:, :starts], right[:, :starts]
    found = paired_difference(left, right, name)
    return {
        "left rate": 100 * left.mean(),
        "right rate": 100 * right.mean(),
        "difference": 100 * found.value,
        "low": 100 * found.low,
        "high": 100 * found.high,
        "p": found.p,
        "n": starts,
    }
