"""The clock of a run as a file of its results folder, for `bench status` in another shell."""

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
    """The file of a run, for the process that runs it."""

    def __init__(self, writer: ResultsWriter) -> None:
        self._writer, self._path = writer, writer.folder / NAME

    def write(self, state: Mapping[str, Any], ended: bool = False) -> None:
        """Writes what `bench.clock.Clock.state` gives, and whether the run has been ended."""
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
        """Removes the file, once there is nothing left to do."""
        self._path.unlink(missing_ok=True)


def read_state(folder: Path) -> dict[str, Any] | None:
    """Returns the state of the run that writes to a folder, or that was ended while it did.

    What `bench.clock.Clock.state` gives, at the present time if the run still lives, and
    ``running``, whether it does. None if there is no such run, or its file cannot be read.
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
    """Whether the process that wrote a state is still there, and no later one of its number."""
    if found["ended"]:
        return False
    if found["host"] != platform.node():
        return bool(time.time() - float(found["written"]) < SILENCE)
    try:
        return bool(psutil.Process(int(found["pid"])).create_time() == float(found["started"]))
    except psutil.Error:
        return False
