"""The cost of jobs in CPU seconds of a reference machine, measured once and shipped in costs.csv.

`bench.measuring` writes the file. `bench plan` and the clock of a run start from these costs.
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path

from bench.spec import EXPERT, ControllerSpec, Evaluation, Fit
from tasks.files import whole_file
from tasks.registry import APPENDIX

TABLE = Path(__file__).with_name("costs.csv")
CONTROLLER, CALIBRATION = "controller", "calibration"
"""Names in the column ``method`` of rows without a method; rows of episodes have `EXPERT`."""
MANY = 5
"""Number of seeds trained together in the second measurement; the first has one seed."""
JOB_SECONDS = 0.4
"""Fixed cost of each job: starting a process, compiling models, storing."""
DECIDED = {"relocation": 0.4, "reorientation": 0.55}
"""Share of its steps after which an episode is decided: the mean over the shipped results. In other
tasks an episode always takes all its steps."""


@dataclass(frozen=True)
class Price:
    """The CPU seconds of one kind of training, or of an episode."""

    task: str
    method: str
    variant: str
    size: str
    seeds: int
    """How many seeds train together."""
    start: float
    """Seconds before the first epoch."""
    epoch: float
    """Seconds for each epoch."""
    demo: float
    """Seconds for each demonstration in each epoch, or for each episode."""

    @property
    def place(self) -> tuple[str, str, str, str, int]:
        """The fields that identify the row."""
        return self.task, self.method, self.variant, self.size, self.seeds

    def seconds(self, demos: int, epochs: float) -> float:
        """Returns the CPU seconds of a training."""
        return self.start + epochs * (self.epoch + demos * self.demo)


@dataclass(frozen=True)
class Cost:
    """The expected duration of a job on the reference machine."""

    kind: str
    """Jobs of one kind are assumed to be mispriced by the same factor."""
    seconds: float
    known: bool = True
    """Whether the table has such a job. If not, the seconds are only a rough guess."""
    count: int = 1
    """How many results the job makes."""


def fit_cost(fits: Sequence[Fit]) -> Cost:
    """Returns the cost of a job that makes fits which differ only in their seeds.

    A method that the table lacks is priced like NN.
    """
    first = fits[0]
    epochs = float(first.config.get("epochs", 1))
    found = _price(first.task, first.method, first.variant, first.size, len(fits))
    price = found or _price(first.task, "nn", "described", "median", len(fits))
    seconds = price.seconds(first.demos, epochs) if price else 0.0
    kind = f"fit {first.method} {first.variant}"
    return Cost(kind, JOB_SECONDS + seconds, found is not None, len(fits))


def controller_cost(specs: Sequence[ControllerSpec]) -> Cost:
    """Returns the cost of a job that trains controllers of one kind together."""
    first, count = specs[0], len(specs)
    price = _price(first.task, CONTROLLER, "", "", count)
    seconds = price.seconds(first.demos, first.config.epochs) if price else 0.0
    return Cost(CONTROLLER, JOB_SECONDS + seconds, price is not None, count)


def evaluation_cost(evaluation: Evaluation, episodes: int, threads: int = 1) -> Cost:
    """Returns the cost of a job that evaluates episodes.

    Args:
        evaluation: the conditions.
        episodes: number of episodes.
        threads: simulator threads, which share the work.
    """
    decided = DECIDED.get(evaluation.task, 1.0) if evaluation.rule == APPENDIX else 1.0
    price = _price(evaluation.task, EXPERT, "", "", 1)
    seconds = decided * episodes * price.demo / threads if price else 0.0
    return Cost(f"episodes of {evaluation.task}", JOB_SECONDS + seconds, price is not None)


def calibration_seconds() -> float:
    """Returns the CPU seconds of the calibration in `bench.machine` on the reference machine."""
    return _table()["", CALIBRATION, "", "", 1].start


def _price(task: str, method: str, variant: str, size: str, seeds: int) -> Price | None:
    """The price of a number of seeds, interpolated from 1 and `MANY` seeds, or extrapolated.

    A task that is not in the table costs as much as Door.
    """
    prices = _table()
    one = prices.get((task, method, variant, size, 1)) or prices.get(
        ("door", method, variant, size, 1)
    )
    many = one and prices.get((one.task, method, variant, size, MANY))
    if one is None or seeds == 1:
        return one
    share = (seeds - 1) / (MANY - 1)
    if many is None:  # the seeds are fitted one after the other
        return Price(*one.place[:-1], seeds, seeds * one.start, seeds * one.epoch, seeds * one.demo)
    between = [
        (1 - share) * getattr(one, name) + share * getattr(many, name)
        for name in ("start", "epoch", "demo")
    ]
    return Price(*one.place[:-1], seeds, *between)


@cache
def _table() -> dict[tuple[str, str, str, str, int], Price]:
    with TABLE.open() as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        numbers = {"seeds": int, "start": float, "epoch": float, "demo": float}
        prices = [Price(**{k: numbers.get(k, str)(v) for k, v in row.items()}) for row in rows]
    return {price.place: price for price in prices}


def write_table(prices: Sequence[Price], machine: str) -> None:
    """Writes the table."""
    with whole_file(TABLE) as whole, whole.open("w", newline="") as file:
        file.write(f"# CPU seconds of: {machine}\n")
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(field.name for field in fields(Price))
        for price in prices:
            rows.writerow(
                (*price.place, *(f"{x:.4g}" for x in (price.start, price.epoch, price.demo)))
            )
