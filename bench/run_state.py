"""The progress of a run, stored in its results folder for `bench status` in another shell."""

import platform
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import psutil

from bench.results_writer import ResultsWriter
from bench.sealed_files import DamagedError, read_record, seal_record

NAME = "progress.json"
SILENCE = 60.0
"""Seconds without news after which a run on another host counts as stopped."""
_KIND = {"name": str, "done": int, "of": int, "failed": int}
_JOB = {"label": str, "seconds": float}


class StateFile:
    """The progress file of a run. Only the process of the run uses it."""

    def __init__(self, writer: ResultsWriter) -> None:
        self._writer, self._path = writer, writer.folder / NAME

    def write(self, state: Mapping[str, Any], ended: bool = False) -> None:
        """Writes a state of `bench.clock.Clock.state`, and whether the run has stopped."""
        me = psutil.Process()
        entry = {
            "written": time.time(),
            "host": platform.node(),
            "pid": me.pid,
            "started": me.create_time(),
            "ended": ended,
        }
        self._writer.write(self._path, seal_record(entry | dict(state)))

    def remove(self) -> None:
        """Removes the file, once the run is complete."""
        self._path.unlink(missing_ok=True)


def read_state(folder: Path) -> dict[str, Any] | None:
    """Returns the state of the run that writes to a folder, or that was stopped before its end.

    It has the entries of `bench.clock.Clock.state`, and ``running``: whether the process of the run
    still exists. If so, times are as of now. None if there is no such run or its file cannot be
    read.
    """
    try:
        found = read_record(folder / NAME)
        state: dict[str, Any] = {
            "running": _lives(found),
            "gone": float(found["gone"]),
            "left": float(found["left"]),
            "kinds": [_typed(kind, _KIND) for kind in found["kinds"]],
            "now": [_typed(job, _JOB) for job in found["now"]],
        }
        age = max(0.0, time.time() - float(found["written"])) if state["running"] else 0.0
    except (DamagedError, ValueError, KeyError, TypeError, OverflowError):
        return None
    state |= {"gone": state["gone"] + age, "left": max(0.0, state["left"] - age)}
    for job in state["now"]:
        job["seconds"] += age
    return state


def _typed(entry: Mapping[str, Any], fields: Mapping[str, type]) -> dict[str, Any]:
    return {name: kind(entry[name]) for name, kind in fields.items()}


def _lives(found: Mapping[str, Any]) -> bool:
    """Whether the process that wrote a state still exists; a new process may reuse its id."""
    if found["ended"]:
        return False
    if found["host"] != platform.node():
        return bool(time.time() - float(found["written"]) < SILENCE)
    try:
        return bool(psutil.Process(int(found["pid"])).create_time() == float(found["started"]))
    except psutil.Error:
        return False
