"""Whether a submitted row can stand beside the shipped results, judged by keys and digests.

It needs what every shipped method has: the test starts and those out of distribution of each task
and seed, learnt from the same demonstrations, with the same controllers and kernels. Nothing of the
method is needed, so a report can judge rows whose package is not installed.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from bench.controller_kinds import NO_CONTROLLER, ORIGINAL
from bench.labels import VALIDATION
from bench.names import KEY_DIGITS, PLAIN
from bench.submission import Submission
from methods.registry import SUITE
from reports.pairing import keep_common, without_expert
from reports.results import SPLITS, Results
from tasks.errors import InputError
from tasks.names import check_name
from tasks.words import count_of

DESCRIBED = "described"
"""The variant that is compared."""
PLACE = ["task", "split", "seed"]


def required(reference: Results) -> pd.DataFrame:
    """Returns the shipped evaluations that a row is compared with, cut to common seeds and starts.

    Args:
        reference: the shipped results.
    """
    rows = [keep_common(without_expert(reference.rows.main(split=split))) for split in SPLITS]
    return pd.concat(rows, ignore_index=True)


def main_rows(results: Results, label: str) -> pd.DataFrame:
    """Returns the rows of a method that are compared: at the size that validation starts choose."""
    rows = [results.rows.main(method=label, split=split) for split in SPLITS]
    return pd.concat(rows, ignore_index=True)


def lacking(rows: pd.DataFrame, needed: pd.DataFrame) -> pd.DataFrame:
    """Returns which `required` rows have no counterpart, or one of fewer starts, in `main_rows`.

    Columns ``task``, ``split``, ``seed`` and ``episodes``, the number of starts needed.
    """
    places = needed.drop_duplicates(PLACE)[[*PLACE, "episodes"]]
    both = places.merge(rows[[*PLACE, "episodes"]], "left", on=PLACE, suffixes=("", " found"))
    return both[~(both["episodes found"] >= both.episodes)][[*PLACE, "episodes"]]


def named(places: pd.DataFrame) -> str:
    """Returns the rows of `lacking` as text."""
    texts = [
        f"{count_of(int(count), 'start')} of {split} on {task}"
        f" (seed{'s' * (len(part) > 1)} {', '.join(map(str, sorted(part.seed)))})"
        for (task, split, count), part in places.groupby(["task", "split", "episodes"], sort=False)
    ]
    return "; ".join(texts)


def check_comparable(row: Results, reference: Results, needed: pd.DataFrame) -> None:
    """Checks that a submitted row is whole, consistent and comparable with the shipped results.

    Args:
        row: the opened file.
        reference: the shipped results.
        needed: what is `required` by them.

    Raises:
        InputError: it is not; the message names every difference.
    """
    assert isinstance(row.source, Submission)
    submission = row.source
    submission.check_keys()
    check_name("method", submission.origin.method, SUITE)
    found = dict.fromkeys(_differences(row, reference, needed))
    if row.frame.settings.nunique() > 1:
        found["it has several values of --set"] = None
    missing = submission.origin.missing
    left = lacking(main_rows(row, submission.origin.method), needed[~needed.task.isin(missing)])
    if len(left):
        found[f"it lacks {named(left)}"] = None
    if shown := sorted(set(missing) & set(row.frame.task)):
        found[f"it says that it leaves out {', '.join(shown)}, which it has"] = None
    if found:
        raise InputError(
            f"{row.folder.name} cannot stand beside the shipped results: {'; '.join(found)}"
        )


def _differences(row: Results, reference: Results, needed: pd.DataFrame) -> Iterator[str]:
    """Yields in what each evaluation differs from the shipped ones of its task and seed."""
    for one in row.frame.to_dict("records"):
        place = f"{one['task']}, seed {one['seed']}"
        shipped = needed[(needed.task == one["task"]) & (needed.seed == one["seed"])]
        if shipped.empty:
            yield f"{place}: the shipped methods have no such seed"
            continue
        plain = all(one[name] == value for name, value in PLAIN.items())
        if not (plain and one["variant"] == DESCRIBED and one["split"] in (*SPLITS, VALIDATION)):
            yield f"{place}: an evaluation under other conditions"
        if one["weights"]:
            yield f"{place}: weights of a file, whose training cannot be repeated"
        for what, mine, theirs in _settings(one, shipped):
            if theirs != {mine}:
                yield f"{place}: {what} {mine[:KEY_DIGITS]}, not {_listed(theirs)}"
        if one["controller"] != NO_CONTROLLER and not _same_fields(row, reference, one):
            yield f"{place}: the controller has not the fields of the shipped one"


def _settings(one: Mapping[str, Any], shipped: pd.DataFrame) -> Iterator[tuple[str, str, set[str]]]:
    """Yields settings by name: that of an evaluation, and those of the shipped ones."""
    demos = set((shipped.demos + shipped.held_out).astype(str))
    yield "number of demonstrations", str(one["demos"] + one["held_out"]), demos
    yield "kernels", one["pins"], set(shipped.pins)
    yield "demonstrations", one["demos_key"], set(shipped.demos_key)
    if one["controller"] != NO_CONTROLLER:
        tracked = shipped[shipped.controller == ORIGINAL]
        yield "controller", one["controller_key"], set(tracked.controller_key)
        yield "kind of controller", one["controller"], {ORIGINAL}


def _same_fields(row: Results, reference: Results, one: Mapping[str, Any]) -> bool:
    """Whether the row says the same of a controller as the shipped results, if those have it."""
    key = one["controller_key"]
    try:
        shipped = reference.controller_spec(key)
    except (InputError, KeyError):
        return True  # then the key differs
    return row.controller_spec(key) == shipped


def _listed(values: set[str]) -> str:
    return " or ".join(sorted(value[:KEY_DIGITS] for value in values)) or "none"
