"""One job in a process of its own: whatever the job does to its process, the next job starts clean.

On Linux the process is forked from a server that has imported what jobs need and has computed
nothing, which takes milliseconds. Elsewhere it is started anew, since system libraries there do not
survive a fork.
"""

import multiprocessing
import os
import pickle
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from multiprocessing import forkserver
from multiprocessing.connection import Connection, wait
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

from tasks.errors import InputError, described

PRELOADED = ["bench.cli", "bench.driver", "methods.guard", "methods.network", "pandas"]
SHOWN = 4000
"""Characters kept of what a job prints, the last ones, and of a traceback."""

PATIENCE = 600.0
"""Seconds for a job that a command waits for."""

Job = Callable[..., Any]


@dataclass(frozen=True)
class Failure:
    """Why there is no result."""

    reason: str
    traceback: str
    tries: int = 1
    died: bool = False
    """Whether the process of the job ended without an answer."""


class Stop(KeyboardInterrupt):
    """The user asked the run to stop. A KeyboardInterrupt of a method's own is a failure."""


def do_here(name: str, job: Job, arguments: tuple[Any, ...]) -> Any:
    """Returns what a job returns, or the `Failure` of one that raises, in this very process.

    Args:
        name: of the job; the global random streams are seeded by it.
        job: what is called.
        arguments: of the call.

    Raises:
        Stop: the user asked for it.
    """
    from methods.guard import guarded  # imports torch, which a worker never needs

    try:
        with guarded("job", name):
            return job(*arguments)
    except Stop:
        raise
    except BaseException as error:
        lines = "".join(traceback.TracebackException.from_exception(error).format())
        return Failure(described(error), _printable(lines))


def apart(job: Job, *arguments: Any) -> Any:
    """Returns what a short job returns that runs in a process of its own.

    Raises:
        InputError: the job fails, or takes longer than `PATIENCE`; the message is the reason.
    """
    call = pickle.dumps((job, arguments))
    found = pickle.loads(do_apart(f"{job.__name__} {arguments}", call, PATIENCE))
    if isinstance(found, Failure):
        raise InputError(found.reason)
    return found


def do_apart(name: str, call: bytes, limit: float) -> bytes:
    """Returns the pickled result or `Failure` of a job that runs in a process of its own.

    Args:
        name: see `do_here`.
        call: the pickled job and its arguments.
        limit: seconds after which the process is killed.
    """
    here, there = _context().Pipe(duplex=False)
    with NamedTemporaryFile(prefix="bench-printed-") as printed:
        process = _context().Process(target=_child, args=(there, printed.name, name, call))
        # A worker of dask is a daemon, which Python allows no children.
        multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
        process.start()
        there.close()
        try:
            answer = _answer(here, process, limit)
        finally:
            here.close()
            _kill(process)
        if isinstance(answer, bytes):
            return answer
        said = _printable(Path(printed.name).read_bytes().decode(errors="backslashreplace"))
        return pickle.dumps(Failure(answer.reason, said, died=answer.died))


def _answer(
    here: Connection, process: multiprocessing.process.BaseProcess, limit: float
) -> bytes | Failure:
    """What the process sends, or why it sends nothing."""
    ready = wait([here, process.sentinel], limit)
    if not ready:
        return Failure(f"it took more than {limit / 60:g} minutes, the limit", "")
    with suppress(EOFError, OSError):
        if here.poll():
            return here.recv_bytes()
    process.join()
    code = process.exitcode or 0
    how = f"ended with exit code {code}" if code >= 0 else f"was killed by {_signal(-code)}"
    return Failure(f"its process {how} before it answered", "", died=True)


def _signal(number: int) -> str:
    name = signal.Signals(number).name
    return f"{name} (perhaps for lack of memory)" if name == "SIGKILL" else name


def _kill(process: multiprocessing.process.BaseProcess) -> None:
    """Ends a process, and those that it has started, whatever they do."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid or 0, signal.SIGKILL)
    process.kill()
    process.join()
    process.close()


def _child(there: Connection, printed: str, name: str, call: bytes) -> None:
    """Does the job, and sends what comes of it."""
    os.setsid()
    threading.Thread(target=_end_with_the_parent, daemon=True).start()
    output = os.open(printed, os.O_WRONLY | os.O_APPEND)
    for source, target in ((os.open(os.devnull, os.O_RDONLY), 0), (output, 1), (output, 2)):
        os.dup2(source, target)
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    result = do_here(name, _pickled, (call,))
    there.send_bytes(result if isinstance(result, bytes) else pickle.dumps(result))
    there.close()


def _pickled(call: bytes) -> bytes:
    job, arguments = pickle.loads(call)
    return pickle.dumps(job(*arguments), protocol=5)


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os.killpg(0, signal.SIGKILL)


def start_server() -> None:
    """Starts what processes of jobs are forked from, and does not wait until it is ready."""
    if _context().get_start_method() == "forkserver":
        forkserver.ensure_running()


@cache
def _context() -> Any:
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    return context


def _printable(text: str) -> str:
    """The end of a text, with what a terminal would obey as escapes."""
    shown = text[-SHOWN:].encode("utf-8", "backslashreplace").decode()
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in shown)
