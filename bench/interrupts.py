"""Stops a run on Ctrl-C, SIGTERM or SIGHUP, and keeps the results of jobs that end soon."""

import os
import signal
import sys
import threading
from contextlib import suppress
from types import FrameType

from bench.isolation import Stop

GRACE = 4.0
"""Seconds after Ctrl-C in which results of running jobs are still stored."""


class Interrupts:
    """Turns Ctrl-C, SIGTERM and SIGHUP into a request to stop. A context manager.

    After the first signal no more jobs are sent, and jobs that end within `GRACE` are stored. The
    second signal stops at once.
    """

    def __init__(self) -> None:
        self.asked = False
        self._timer: threading.Timer | None = None

    def __enter__(self) -> "Interrupts":
        heard = threading.current_thread() is threading.main_thread()
        numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP) if heard else ()
        ignored = {number for number in numbers if signal.getsignal(number) is signal.SIG_IGN}
        self._before = {
            number: signal.signal(number, self._stop) for number in numbers if number not in ignored
        }
        return self

    def __exit__(self, *error: object) -> None:
        if self._timer:
            self._timer.cancel()
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def check(self) -> None:
        """Raises Stop if a signal has come."""
        if self.asked:
            raise Stop

    def _stop(self, number: int, frame: FrameType | None) -> None:
        self.check()
        self.asked = True
        with suppress(OSError):  # the terminal may be closed
            print(
                f"stopping: results of the next {GRACE:.0f} s are kept; Ctrl-C again stops at once",
                file=sys.stderr,
            )
        # The same signal again: another may be ignored, as Ctrl-C is in the background of a script.
        self._timer = threading.Timer(GRACE, os.kill, (os.getpid(), number))
        self._timer.daemon = True
        self._timer.start()
