"""Shows the progress of a run: live on a terminal, as plain lines elsewhere, and in a file."""

import sys
import threading
from collections.abc import Callable
from contextlib import suppress

from rich.console import Console
from rich.live import Live
from rich.text import Text

from bench.clock import Clock, counted, headline, running
from bench.doing import hush
from bench.job_queue import Job
from bench.run_state import StateFile

EVERY = 30.0
"""Seconds between two lines where stderr is no terminal."""
SHOWN = 1.0
"""Seconds between two updates of a terminal."""
SAVED = 10.0
"""Seconds between two updates of the file while no job starts or ends."""


class Progress:
    """Shows the clock of a run while its jobs run. A context manager.

    Its methods may be called from several threads.
    """

    def __init__(self, title: str, clock: Clock, file: StateFile, now: Callable[[], float]) -> None:
        """Shows nothing until `begin`.

        Args:
            title: title of the run.
            clock: the clock to show.
            file: receives the state of the clock, at most once a second.
            now: returns the current time of the clock.
        """
        self._title, self._clock, self._file, self._now = title, clock, file, now
        self._lock = threading.RLock()
        self._ended = threading.Event()
        self._ticking = threading.Thread(target=self._tick, daemon=True)
        self._begun = self._news = False
        self._shown, self._shown_at = "", -SHOWN
        self._said = self._saved = 0.0
        console = Console(stderr=True)
        self._live = Live(
            console=console,
            get_renderable=self._render,
            refresh_per_second=2,
            redirect_stdout=sys.stdout.isatty(),
        )
        self._plain = not console.is_terminal or console.is_dumb_terminal

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *error: object) -> None:
        self._ended.set()
        if self._begun:
            self._ticking.join()
            if not self._plain:
                self._live.stop()
        if error[0] is None:
            self._file.remove()
        elif self._begun:
            self._keep(ended=True)

    def begin(self) -> None:
        """Starts showing the clock, if there are jobs."""
        if self._clock.over:
            return
        self._begun = True
        hush()
        self._say()
        self._keep()
        self._ticking.start()
        if not self._plain:
            self._live.start()

    def start(self, job: Job) -> None:
        """See `bench.clock.Clock.start`."""
        with self._lock:
            self._clock.start(job, self._now())
            self._news = True

    def end(self, job: Job, seconds: float, failed: bool = False) -> None:
        """See `bench.clock.Clock.end`."""
        with self._lock:
            self._clock.end(job, seconds, self._now(), failed)
            self._news = True
        if self._clock.over:
            self._say()

    def _tick(self) -> None:
        while not self._ended.wait(1.0):
            self._tick_once()

    def _tick_once(self) -> None:
        now = self._now()
        if now - self._said >= EVERY:
            self._say()
        if self._news or now - self._saved >= SAVED:
            self._keep()

    def _keep(self, ended: bool = False) -> None:
        with self._lock:
            self._news, self._saved = False, self._now()
            state = self._clock.state(self._now())
        with suppress(OSError):  # the run itself reports a full disk
            self._file.write(state, ended)

    def _say(self) -> None:
        with self._lock:
            self._said = self._now()
            if self._plain:
                print("; ".join(self._lines()), file=sys.stderr, flush=True)

    def _render(self) -> Text:
        with self._lock:
            if self._now() - self._shown_at >= SHOWN:
                self._shown, self._shown_at = "\n ".join(self._lines()), self._now()
            return Text(self._shown, no_wrap=True, overflow="crop")

    def _lines(self) -> list[str]:
        state = self._clock.state(self._now())
        now = running(state)
        return [
            f"{self._title}: {headline(state)}",
            counted(state),
            *([f"now: {now}"] if now else []),
        ]
