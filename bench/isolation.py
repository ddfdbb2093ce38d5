"""Runs a job in its own process, so that it cannot affect the jobs after it.

On Linux the process is forked, in a tenth of a second, from a server that has imported the
libraries of jobs but has computed nothing. On other systems a new interpreter starts, since their
system libraries do not survive a fork.
"""

import atexit
import ctypes
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cache
from glob import escape
from multiprocessing import forkserver
from multiprocessing.connection import Connection, wait
from pathlib import Path
from pickle import dumps, loads  # by name, in case a method changes the module
from platform import node
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any

import psutil

from tasks.errors import InputError, described, reason_of
from tasks.pins import check_environment

PRELOADED = ["bench.cli", "bench.driver", "methods.guard", "methods.network", "pandas"]
SHOWN = 4000
"""Characters that are kept of a job's output and of a traceback: the last ones."""

PATIENCE = 600.0
"""Time limit in seconds of a job that a command waits for."""

_FOLDER = f"bench-job-{node()}-"
"""How the name of a job's folder begins, before the process id of its worker. Hosts may share a
temporary folder."""
_PRINTED = "printed"
"""Name of the file in a job's folder that holds the job's output."""
_COUNTED = 2**24
"""Bytes of a job's output in which lines are counted."""
_LONGEST_FOLDER = 60
_SET_CHILD_SUBREAPER = 36
"""Option number of Linux's prctl."""

Job = Callable[..., Any]


@dataclass(frozen=True)
class Failure:
    """Why a job returned no result."""

    reason: str
    traceback: str
    tries: int = 1
    died: bool = False
    """Whether the process of the job ended before it returned anything."""


class Stop(KeyboardInterrupt):
    """The user stops the run. A KeyboardInterrupt that a method raises is a failure instead."""


def do_here(name: str, job: Job, arguments: tuple[Any, ...]) -> Any:
    """Calls a job in this process; returns its result, or a `Failure` if it raises.

    Args:
        name: name of the job, which seeds the global random streams.
        job: the function to call.
        arguments: its arguments.

    Raises:
        Stop: the user stops the run.
    """
    from methods.guard import guarded  # imports torch, which a worker never needs

    try:
        with guarded("job", name):
            return job(*arguments)
    except Stop:
        raise
    except BaseException as error:
        return Failure(reason_of(error), _printable(_traceback(error)))


def _traceback(error: BaseException) -> str:
    try:
        return "".join(traceback.TracebackException.from_exception(error).format())
    except BaseException:  # a method's exception may fail to format itself
        return ""


def apart(job: Job, *arguments: Any) -> Any:
    """Runs a short job in its own process and returns its result.

    Raises:
        InputError: the job fails, or takes longer than `PATIENCE`; the message is the reason. See
            also `tasks.pins.check_environment`.
    """
    return _result(_context(), job, arguments)


def afresh(job: Job, *arguments: Any) -> Any:
    """Does the same in a new interpreter, which hashes texts differently. It takes seconds."""
    return _result(multiprocessing.get_context("spawn"), job, arguments)


def _result(context: Any, job: Job, arguments: tuple[Any, ...]) -> Any:
    check_environment()
    call = dumps((job, arguments))
    found = read_answer(_do_in(context, job.__name__, call, PATIENCE))
    if isinstance(found, Failure):
        raise InputError(found.reason)
    return found


def read_answer(answer: bytes) -> Any:
    """Returns the unpickled result of `do_apart`, or a `Failure` if it cannot be unpickled."""
    try:
        return loads(answer)
    except Exception as error:
        return Failure(f"its answer cannot be read: {described(error)}", "")


def do_apart(name: str, call: bytes, limit: float) -> bytes:
    """Runs a job in its own process; returns its pickled result or `Failure`.

    Args:
        name: see `do_here`.
        call: the pickled job and its arguments.
        limit: seconds after which the process is killed.
    """
    return _do_in(_context(), name, call, limit)


def _do_in(context: Any, name: str, call: bytes, limit: float) -> bytes:
    here, there = context.Pipe(duplex=False)
    folder = TemporaryDirectory(prefix=f"{_FOLDER}{os.getpid()}-", ignore_cleanup_errors=True)
    others = {*psutil.Process().children()}
    with folder as place, _adopting_orphans():
        process = context.Process(target=_child, args=(there, place, name, call))
        # Python forbids a daemon, such as a dask worker, to start processes.
        multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
        process.start()
        there.close()
        try:
            answer = _answer(here, process, limit)
        finally:
            here.close()
            _kill(process, others)
        if isinstance(answer, bytes):
            return answer
        return dumps(replace(answer, traceback=_printed(place)))


def _answer(
    here: Connection, process: multiprocessing.process.BaseProcess, limit: float
) -> bytes | Failure:
    """The bytes that the process sends, or a failure that says why it sends nothing."""
    end = monotonic() + limit
    if wait([here, process.sentinel], limit):
        with suppress(EOFError, OSError):
            if here.poll():
                return here.recv_bytes()
        process.join(max(0.0, end - monotonic()))
    if process.exitcode is None:
        return Failure(f"it exceeded the limit of {limit / 60:g} minutes", "")
    code = process.exitcode
    how = f"ended with exit code {code}" if code >= 0 else f"was killed by {_signal(-code)}"
    return Failure(f"its process {how} before it returned a result", "", died=True)


def _signal(number: int) -> str:
    try:
        name = signal.Signals(number).name
    except ValueError:  # a real-time signal
        name = f"signal {number}"
    return f"{name} (perhaps for lack of memory)" if name == "SIGKILL" else name


def _kill(process: multiprocessing.process.BaseProcess, others: set[psutil.Process]) -> None:
    """Kills a process and all that it has started: its group, and orphans of other sessions.

    Args:
        process: the process of a job.
        others: children that this process had before.
    """
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid or 0, signal.SIGKILL)
    process.kill()
    process.join()
    process.close()
    here = os.getsid(0)
    for adopted in {*psutil.Process().children()} - others:
        with suppress(psutil.Error, ProcessLookupError):
            if os.getsid(adopted.pid) != here:  # the server of processes is no orphan
                for orphan in (adopted, *adopted.children(recursive=True)):
                    orphan.kill()
                    orphan.wait(1)


@contextmanager
def _adopting_orphans() -> Iterator[None]:
    """Makes this process adopt the orphans of a job, so that it can kill them."""
    prctl = ctypes.CDLL(None).prctl if sys.platform == "linux" else lambda *numbers: None
    prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    try:
        yield
    finally:
        prctl(_SET_CHILD_SUBREAPER, 0, 0, 0, 0)


def _child(there: Connection, place: str, name: str, call: bytes) -> None:
    """Runs the job and sends its result."""
    os.setsid()
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    output = os.open(f"{place}/{_PRINTED}", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for source, target in ((os.open(os.devnull, os.O_RDONLY), 0), (output, 1), (output, 2)):
        os.dup2(source, target)
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    tempfile.tempdir = place
    result = do_here(name, _pickled, (call,))
    if isinstance(result, Failure):
        with suppress(Exception):
            sys.stdout.flush()
        result = dumps(replace(result, traceback=result.traceback + _printed(place)))
    there.send_bytes(result)
    there.close()


def printed(lines: int) -> tuple[tuple[str, ...], int]:
    """Returns the first lines that this job has printed so far, and the number of all its lines.

    Lines are counted in the first `_COUNTED` bytes. To be called only in the process of a job,
    whose output goes to a file.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):
            stream.flush()
    ctypes.CDLL(None).fflush(None)  # output of C libraries
    said: list[bytes] = []
    with suppress(OSError), Path(tempfile.gettempdir(), _PRINTED).open("rb") as file:
        said = file.read(_COUNTED).splitlines()
    first = (line[:SHOWN].decode(errors="backslashreplace").rstrip() for line in said[:lines])
    return tuple(map(_printable, first)), len(said)


def _printed(place: str) -> str:
    """The end of a job's output."""
    with suppress(OSError), Path(place, _PRINTED).open("rb") as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - 4 * SHOWN))
        said = _printable(file.read(4 * SHOWN).decode(errors="backslashreplace"))
        return f"\nIt printed:\n{said}" if said.strip("\0") else ""
    return ""


def _pickled(call: bytes) -> bytes:
    job, arguments = loads(call)
    return dumps(job(*arguments), protocol=5)


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os.killpg(0, signal.SIGKILL)


def start_server() -> None:
    """Starts the server that processes of jobs are forked from, without waiting for it.

    Removes leftover folders of jobs whose worker was killed.
    """
    for folder in Path(tempfile.gettempdir()).glob(f"{escape(_FOLDER)}*-*"):
        worker = folder.name.removeprefix(_FOLDER).partition("-")[0]
        if worker.isdecimal() and not psutil.pid_exists(int(worker)):
            shutil.rmtree(folder, ignore_errors=True)
    if _context().get_start_method() == "forkserver":
        forkserver.ensure_running()


@cache
def _context() -> Any:
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    _shorten_the_folder_of_sockets()
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    return context


def _shorten_the_folder_of_sockets() -> None:
    """Puts sockets into /tmp if TMPDIR is long: their paths have at most about 100 characters."""
    config = multiprocessing.current_process()._config  # type: ignore[attr-defined]
    if len(tempfile.gettempdir()) > _LONGEST_FOLDER and config.get("tempdir") is None:
        config["tempdir"] = tempfile.mkdtemp(prefix=f"{_FOLDER}{os.getpid()}-", dir="/tmp")
        atexit.register(shutil.rmtree, config["tempdir"], ignore_errors=True)


def _printable(text: str) -> str:
    """The end of a text, with control characters escaped."""
    shown = text[-SHOWN:].encode("utf-8", "backslashreplace").decode()
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in shown)
