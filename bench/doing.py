"""Says on stderr what a command is doing, if it takes longer than a moment."""

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import psutil
from rich.console import Console
from rich.live import Live
from rich.text import Text

from bench.clock import duration

MOMENT = 1.0
"""Seconds before a command says what it is doing."""
EVERY = 5.0
"""Seconds between two lines where stderr is no terminal."""


class _Doing:
    """The line of a command: updated in place on a terminal, printed at intervals elsewhere."""

    def __init__(self, what: str) -> None:
        console = Console(stderr=True)
        self._plain = not console.is_terminal or console.is_dumb_terminal
        self._what, self._printed = what, ""
        self._began = self._since = time.monotonic()
        self._next = self._began + MOMENT
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._ticking = threading.Thread(target=self._tick, daemon=True)
        self._live = Live(
            console=console,
            get_renderable=self._render,
            transient=True,
            refresh_per_second=2,
            redirect_stdout=sys.stdout.isatty(),  # else stdout may be JSON for a program
        )

    def begin(self) -> None:
        self._show()
        self._ticking.start()

    def say(self, what: str) -> None:
        self._what, self._since = what, time.monotonic()
        self._show()

    def end(self) -> None:
        self._ended.set()
        self._ticking.join()
        self._live.stop()

    def _tick(self) -> None:
        while not self._ended.wait(0.25):
            self._show()

    def _show(self) -> None:
        with self._lock:
            if time.monotonic() < self._next or self._ended.is_set():
                return
            if not self._plain:
                self._live.start()
            elif self._what != self._printed:
                print(f"bench: {self._what}", file=sys.stderr, flush=True)
                self._printed, self._next = self._what, time.monotonic() + EVERY

    def _render(self) -> Text:
        took = duration(time.monotonic() - self._since)
        return Text(f"bench: {self._what}, {took}", no_wrap=True, overflow="crop")


_PRESENT: list[_Doing] = []


@contextmanager
def doing(what: str) -> Iterator[None]:
    """Says on stderr what happens in the context, unless it ends within a moment.

    Args:
        what: the first step, such as ``checking the study``; `say` announces the next ones.
    """
    present = _Doing(what)
    _PRESENT.append(present)
    present.begin()
    try:
        yield
    finally:
        _PRESENT.remove(present)
        present.end()


def since_start() -> float:
    """Returns the seconds since this process started, imports included."""
    return max(0.0, time.time() - psutil.Process().create_time())


def hush() -> None:
    """Stops the line of this context, since something else now shows the progress."""
    if _PRESENT:
        _PRESENT[-1].end()


def say(what: str) -> None:
    """Announces the next step of the current `doing` context, if there is one."""
    if _PRESENT:
        _PRESENT[-1].say(what)
