"""How far a run is: bars on a terminal, plain lines elsewhere."""

from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
from rich.progress import Progress as Bars


@dataclass(frozen=True)
class Cost:
    """What a job is expected to cost."""

    kind: str
    """Jobs of one kind cost in proportion to their units."""
    units: float


class Progress:
    """Counts the jobs of one round after another. A context manager."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._console = Console(stderr=True)
        self._bars = Bars(
            TextColumn("{task.description:<12}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[left]} [dim]{task.fields[latest]}"),
            console=self._console,
            disable=not self._console.is_terminal,
        )

    def __enter__(self) -> "Progress":
        self._bars.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._bars.stop()

    def begin(self, round_: str, costs: Sequence[Cost]) -> None:
        """A round of jobs begins."""
        self._round, self._total = round_, len(costs)
        self._waiting = dict(enumerate(costs))
        self._spent: dict[str, tuple[float, float]] = {}
        self._bar = self._bars.add_task(round_, total=self._total, left="", latest="")
        self._say(f"{round_} 0/{self._total}")

    def advance(self, index: int, seconds: float, label: str) -> None:
        """A job has been committed, after so many seconds of work."""
        cost = self._waiting.pop(index)
        spent, units = self._spent.get(cost.kind, (0.0, 0.0))
        self._spent[cost.kind] = spent + seconds, units + cost.units
        done, left = self._total - len(self._waiting), f"about {_text(self.left())} left"
        self._bars.update(self._bar, completed=done, left=left, latest=label)
        self._say(f"{self._round} {done}/{self._total}, {left}: {label}")

    def _say(self, line: str) -> None:
        if not self._console.is_terminal:
            self._console.print(line, highlight=False, soft_wrap=True)

    def left(self) -> float:
        """Returns the seconds that the round will still take, by what its jobs have taken so far.

        A kind that none has ended of is priced like the mean of the others.
        """
        seconds, units = map(sum, zip(*self._spent.values(), strict=True))
        otherwise = seconds / units
        prices = {kind: spent / amount for kind, (spent, amount) in self._spent.items()}
        work = (cost.units * prices.get(cost.kind, otherwise) for cost in self._waiting.values())
        return sum(work) / min(self._jobs, max(1, len(self._waiting)))


def _text(seconds: float) -> str:
    """Minutes and hours where seconds would be too fine."""
    for size, unit in ((3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
