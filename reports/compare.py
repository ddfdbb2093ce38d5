"""`bench compare`: pairs of methods on the same starts of each task."""

from collections.abc import Sequence
from itertools import combinations

import pandas as pd
from scipy.stats import false_discovery_control

from bench.doing import say
from bench.labels import labels_of
from reports.results import SPLITS, Results
from reports.stats import paired_difference
from reports.style import TASKS
from tasks.data import BoolArray
from tasks.errors import InputError


def compare(results: Results, methods: Sequence[str]) -> pd.DataFrame:
    """Returns one row for each task, split and pair of methods, on common seeds and starts.

    Columns: ``task``, ``split``, ``left``, ``right``; ``left rate`` and ``right rate`` [%]; their
    ``difference`` in points with the 95% interval ``low`` to ``high``; ``p``, and ``q``, which is p
    after control of the false discovery rate over all rows (Benjamini and Hochberg); ``n`` starts.

    Raises:
        InputError: there are fewer than two methods, a method has no results, or no two methods
            have common starts.
    """
    methods = _labels(results, methods)
    if len(methods) < 2:
        raise InputError(f"two or more methods are compared, got {', '.join(methods)}")
    rows = []
    for task in TASKS:
        for split in SPLITS:
            say(f"comparing {', '.join(methods)} on {task}, {split}")
            for names in combinations(methods, 2):
                left, right = results.paired_success([_at(results, m, task, split) for m in names])
                if left is not None and right is not None:
                    found = _difference(left, right, f"{task} {split} {' '.join(names)}")
                    place = {"task": task, "split": split, "left": names[0], "right": names[1]}
                    rows.append(place | found)
    if not rows:
        raise InputError(f"{', '.join(methods)} have met no starts in common")
    table = pd.DataFrame(rows)
    return table.assign(q=false_discovery_control(table.p))


def compared_rows(results: Results, methods: Sequence[str]) -> pd.DataFrame:
    """Returns the evaluations that `compare` compares."""
    parts = [
        results.main(method=method, split=split, controller=_controller(results, method))
        for method in _labels(results, methods)
        for split in SPLITS
    ]
    return pd.concat(parts)


def _labels(results: Results, names: Sequence[str]) -> list[str]:
    """Returns the distinct labels that the names of methods stand for."""
    known = list(results.select().method.unique())
    return list(dict.fromkeys(label for name in names for label in labels_of(name, known)))


def _controller(results: Results, method: str) -> str:
    controllers = results.select(method=method).controller.unique()
    return "original" if "original" in controllers else "none"


def _at(results: Results, method: str, task: str, split: str) -> dict[str, str]:
    controller = _controller(results, method)
    return {"method": method, "task": task, "split": split, "controller": controller}


def _difference(left: BoolArray, right: BoolArray, name: str) -> dict[str, float]:
    found = paired_difference(left, right, name).in_points
    return {
        "left rate": 100 * left.mean(),
        "right rate": 100 * right.mean(),
        "difference": found.value,
        "low": found.low,
        "high": found.high,
        "p": found.p,
        "n": left.shape[1],
    }
