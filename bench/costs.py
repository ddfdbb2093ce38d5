"""What jobs cost: CPU seconds of a reference machine, measured once and shipped in costs.csv.

`bench.measuring` writes the file. `bench plan` and the clock of a run start from the same costs.
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path

from bench.spec import EXPERT, ControllerSpec, Evaluation, Fit
from tasks.registry import APPENDIX

TABLE = Path(__file__).with_name("costs.csv")
CONTROLLER, CALIBRATION = "controller", "calibration"
"""What stands for a method in rows that are of none; `EXPERT` in those of episodes."""
MANY = 5
"""Seeds that are measured together, beside one alone."""
JOB_SECONDS = 0.4
"""What each job costs besides its work: a process, models that are compiled anew, storing."""
DECIDED = {"relocation": 0.4, "reorientation": 0.55}
"""Share of its steps that an episode takes until it is decided, the mean over the shipped results;
all of them in other tasks."""


@dataclass(frozen=True)
class Price:
    """The CPU seconds of one kind of training, or of an episode, which has no epochs."""

    task: str
    method: str
    variant: str
    size: str
    seeds: int
    """How many train together."""
    start: float
    """Before the first epoch."""
    epoch: float
    """For each epoch."""
    demo: float
    """For each demonstration in each epoch; for each episode."""

    @property
    def place(self) -> tuple[str, str, str, str, int]:
        """What tells it apart."""
        return self.task, self.method, self.variant, self.size, self.seeds

    def seconds(self, demos: int, epochs: float) -> float:
        """Returns the CPU seconds of a training."""
        return self.start + epochs * (self.epoch + demos * self.demo)


@dataclass(frozen=True)
class Cost:
    """What a job is expected to take on the reference machine."""

    kind: str
    """Jobs of one kind are mispriced by the same factor."""
    seconds: float
    known: bool = True
    """Whether the table has such a job; else the seconds are in proportion at best."""
    count: int = 1
    """How many results come of it."""


def fit_cost(fits: Sequence[Fit]) -> Cost:
    """Returns the cost of the job that does fits which differ in their seeds alone.

    A method that the table lacks is priced like NN.
    """
    first = fits[0]
    epochs = float(first.config.get("epochs", 1))
    found = _price(first.task, first.method, first.variant, first.size, len(fits))
    price = found or _price(first.task, "nn", "described", "median", len(fits))
    seconds = price.seconds(first.demos, epochs) if price else 0.0
    kind = f"fit {first.method} {first.variant}"
    return Cost(kind, JOB_SECONDS + seconds, found is not None, len(fits))


def controller_cost(spec: ControllerSpec) -> Cost:
    """Returns the cost of the job that trains a controller."""
    price = _price(spec.task, CONTROLLER, "", "", 1)
    seconds = price.seconds(spec.demos, spec.config.epochs) if price else 0.0
    return Cost(CONTROLLER, JOB_SECONDS + seconds, price is not None)


def evaluation_cost(evaluation: Evaluation, episodes: int, threads: int = 1) -> Cost:
    """Returns the cost of the job that evaluates so many episodes.

    Args:
        evaluation: its conditions.
        episodes: how many.
        threads: of the simulator, among which the work is divided.
    """
    decided = DECIDED.get(evaluation.task, 1.0) if evaluation.rule == APPENDIX else 1.0
    price = _price(evaluation.task, EXPERT, "", "", 1)
    seconds = decided * episodes * price.demo / threads if price else 0.0
    return Cost(f"episodes of {evaluation.task}", JOB_SECONDS + seconds, price is not None)


def calibration_seconds() -> float:
    """Returns what the calibration of `bench.machine` takes on the reference machine."""
    return _table()["", CALIBRATION, "", "", 1].start


def _price(task: str, method: str, variant: str, size: str, seeds: int) -> Price | None:
    """The price of so many seeds, between or beyond the numbers of seeds that were measured.

    A task that is not in the table costs what Door does.
    """
    prices = _table()
    one = prices.get((task, method, variant, size, 1)) or prices.get(
        ("door", method, variant, size, 1)
    )
    many = one and prices.get((one.task, method, variant, size, MANY))
    if one is None or seeds == 1:
        return one
    share = (seeds - 1) / (MANY - 1)
    if many is None:  # they are fitted one after the other
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
    with TABLE.open("w", newline="") as file:
        file.write(f"# CPU seconds of: {machine}\n")
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(field.name for field in fields(Price))
        for price in prices:
            rows.writerow(
                (*price.place, *(f"{x:.4g}" for x in (price.start, price.epoch, price.demo)))
            )
