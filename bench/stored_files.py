"""The files of a results folder: what each kind holds, and its check.

Functions that read raise DamagedError if a file is damaged or belongs to another place.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyarrow as pa

from bench.names import ADDED, KEY_DIGITS, PLAIN, Named, evaluation_name, failure_path
from bench.sealed_files import (
    check,
    content_names,
    read_folder,
    read_labels,
    read_record,
    reading,
    seal_folder,
    seal_record,
    seal_table,
)
from tasks.data import NonFinite
from tasks.pins import MARKS

if TYPE_CHECKING:
    from bench.spec import Evaluation
    from tasks.data import Episodes

FIT, CONTROLLER, TIMES = "fit.json", "controller.json", "times.json"
WEIGHTS, DIAGNOSTICS = "weights.safetensors", "diagnostics.safetensors"


# Fits and controllers
def seal_learnt(
    name: str,
    named: Named,
    spec: Mapping[str, Any],
    contents: Mapping[str, bytes],
    facts: Mapping[str, Any],
) -> dict[str, bytes]:
    """Returns the files of the folder of a fit or controller.

    Args:
        name: `FIT` or `CONTROLLER`.
        named: the fit or controller.
        spec: its fields.
        contents: content of its files by name; empty ones are left out.
        facts: times, host and versions.
    """
    record = {"key": named.key, "spec": dict(spec), "facts": dict(facts)}
    return seal_folder(name, record, {file: data for file, data in contents.items() if data})


def read_learnt(folder: Path, name: str) -> dict[str, Any]:
    """Returns the record of a fit or controller, with ``key``, ``spec`` and ``facts``."""
    record, path = read_folder(folder, name), folder / name
    with reading(path):
        check(folder.name.endswith(f"-{record['key'][:KEY_DIGITS]}"), path, "its key")
        check(all(isinstance(record[part], dict) for part in ("spec", "facts")), path, name)
        for spec in (record["spec"], record["spec"].get("start") or record["spec"]):
            check(spec.get("pins") in MARKS, path, "the mark of its kernels")
        check({*content_names(record)} <= {WEIGHTS, DIAGNOSTICS}, path, name)
    return record


# Times and failures
class Times(NamedTuple):
    """Measured CPU seconds."""

    fit: Sequence[float]
    """Of the whole fit."""
    action: Sequence[float] = ()
    """Of one control step of one episode; unknown in results of version 0.1."""


def seal_times(folder: str, times: Times) -> bytes:
    """Returns the content of `TIMES` in the folder of that name."""
    seconds, action = list(times.fit), list(times.action)
    return seal_record({"folder": folder, "seconds": seconds, "action_seconds": action})


def read_times(path: Path) -> Times:
    """Returns the measured times of a fit."""
    record = read_record(path)
    with reading(path):
        check(record["folder"] == path.parent.name, path, "its place")
        found = record["seconds"], record.get("action_seconds", [])
        return Times(*([float(seconds) for seconds in measured] for measured in found))


def seal_failure(label: str, tries: int, reason: str, traceback: str) -> bytes:
    """Returns the content of a failure."""
    return seal_record({"label": label, "tries": tries, "reason": reason, "traceback": traceback})


def read_failure(path: Path) -> dict[str, Any]:
    """Returns ``label``, ``tries``, ``reason`` and ``traceback`` of a failure."""
    record = read_record(path)
    with reading(path):
        check(type(record["tries"]) is int, path, "tries")
        texts = [record[name] for name in ("label", "reason", "traceback")]
        check(all(isinstance(text, str) for text in texts), path, "a text")
        check(failure_path(Path(), record["label"]).name == path.name, path, "its place")
    return {name: record[name] for name in ("label", "tries", "reason", "traceback")}


# Episodes
def episodes_to_table(episodes: "Episodes") -> pa.Table:
    """Returns episodes as a table with a row each, in which readings are float32."""
    readings = episodes.readings.astype(np.float32)
    columns = {
        "start": pa.array(episodes.starts.index),
        "success": pa.array(episodes.success),
        "diverged": pa.array(episodes.diverged),
        "steps": pa.array(episodes.steps.astype(np.int16)),
        "readings": pa.FixedSizeListArray.from_arrays(readings.ravel(), readings.shape[1]),
    }
    return pa.table(columns)


def seal_evaluation(
    fit_key: str,
    key: str,
    evaluation: "Evaluation",
    table: pa.Table,
    non_finite: Sequence[NonFinite],
    software: Sequence[Mapping[str, Any]],
) -> bytes:
    """Returns the content of an evaluation's file.

    Args:
        fit_key: key of the fit that was evaluated.
        key: key of the evaluation.
        evaluation: its conditions.
        table: the table of `episodes_to_table`.
        non_finite: which answers of the method were not finite.
        software: that computed the episodes, see `bench.provenance.software`; several if they were
            added to later.
    """
    labels = {name: str(value) for name, value in asdict(evaluation).items()}
    labels |= {"fit": fit_key, "key": key}
    labels |= {"successes": _count(table, "success"), "diverged": _count(table, "diverged")}
    labels["software"] = json.dumps(software, sort_keys=True)
    if non_finite:
        labels["non_finite"] = json.dumps([asdict(one) for one in non_finite])
    return seal_table(table, labels)


def read_evaluation(path: Path, fit_key: str) -> tuple[dict[str, str], int]:
    """Returns the labels of an evaluation of a fit, and its number of episodes.

    Labels: the fields of `Evaluation`, ``key``, ``successes``, ``diverged``, ``software``, see
    `software_of`, and ``non_finite`` if answers of the method were not finite, see `non_finite_of`.
    """
    found, count = read_labels(path)
    labels = {name: str(PLAIN[name]) for name in ADDED} | found
    with reading(path):
        place = labels["fit"], evaluation_name(labels)
        check(place == (fit_key, path.stem), path, "its place")
        check({"key", "controller_key", "software"} <= {*labels}, path, "its key")
        check(max(int(labels["successes"]), int(labels["diverged"])) <= count, path, "a count")
        numbers = [n for one in non_finite_of(labels) for n in (one.row, one.starts, one.first)]
        check(all(type(number) is int for number in numbers), path, "what was not finite")
    return labels, count


def non_finite_of(labels: Mapping[str, str]) -> list[NonFinite]:
    """Returns which answers of a method were not finite, by the labels of an evaluation."""
    return [NonFinite(**row) for row in json.loads(labels.get("non_finite", "[]"))]


def software_of(labels: Mapping[str, str]) -> list[dict[str, Any]]:
    """Returns the software that computed episodes, by the labels of an evaluation."""
    return list(json.loads(labels["software"]))


def _count(table: pa.Table, column: str) -> str:
    return str(int(np.sum(table[column].to_numpy())))
