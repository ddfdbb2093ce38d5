"""How far a run is: bars on a terminal, plain lines elsewhere."""

import time

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars


class Progress:
    """Counts the jobs of one round after another. A context manager."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._bars = Bars(
            TextColumn("{task.description:<12}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("left:"),
            TimeRemainingColumn(),
            TextColumn("[dim]{task.fields[latest]}"),
            console=self._console,
            disable=not self._console.is_terminal,
        )

    def __enter__(self) -> "Progress":
        self._bars.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._bars.stop()

    def begin(self, kind: str, jobs: int) -> None:
        """A round of jobs begins."""
        self._kind, self._jobs, self._done, self._began = kind, jobs, 0, time.monotonic()
        self._bar = self._bars.add_task(kind, total=jobs, latest="")

    def advance(self, label: str) -> None:
        """One of them has been committed."""
        self._done += 1
        self._bars.update(self._bar, completed=self._done, latest=label)
        if not self._console.is_terminal:
            seconds = time.monotonic() - self._began
            left = seconds / self._done * (self._jobs - self._done)
            self._console.print(
                f"{self._kind} {self._done}/{self._jobs}, about {left:.0f} s left: {label}",
                highlight=False,
                soft_wrap=True,
            )
