"""Measures bench/costs.csv: ``python -m bench.measuring``, about ten minutes on one core.

It measures CPU time, which other work on the machine hardly affects. Each training is shortened to
a few epochs on some of the expert's demonstrations; `bench.costs` extrapolates.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from time import process_time

from threadpoolctl import threadpool_limits

from bench.controller import ControllerConfig, train_controller
from bench.costs import CALIBRATION, CONTROLLER, MANY, Price, write_table
from bench.machine import calibrate, describe_machine, warm_up
from bench.spec import EXPERT
from methods.base import config_of
from methods.registry import SUITE, get_method
from tasks.data import Demos
from tasks.demos import load_demos, split
from tasks.experts import load_expert
from tasks.registry import TASKS, get_task
from tasks.simulator import rollout

FEW, MORE, MOST = 25, 50, 100
"""Numbers of demonstrations that a training is measured with: `FEW`, then `MORE` if an epoch is
slow, or `MOST` if it is fast."""
LONG = 0.6
"""Seconds from which an epoch on `FEW` demonstrations counts as slow."""
EPISODES = 60

Train = Callable[[Demos, int], object]
"""Trains on demonstrations for a number of epochs."""


def measure(tasks: Sequence[str] = TASKS) -> Iterator[Price]:
    """Yields the cost on this machine of everything that the preset ``paper`` computes."""
    warm_up()
    yield Price("", CALIBRATION, "", "", 1, min(calibrate() for _ in range(3)), 0.0, 0.0)
    for task in tasks:
        yield Price(task, EXPERT, "", "", 1, 0.0, 0.0, _episode_seconds(task))
        yield Price(task, CONTROLLER, "", "", 1, *_training_seconds(task, _controller))
        for name in SUITE:
            yield from _fit_prices(task, name)


def _episode_seconds(name: str) -> float:
    """The CPU seconds of an expert's episode. A hand at rest touches nothing and takes half."""
    task = get_task(name)
    starts, expert = task.sample("train", EPISODES), load_expert(task).policy
    whole = partial(rollout, task, starts, expert, chunk=EPISODES, threads=1, whole=True)
    return _seconds(whole) / EPISODES


def _controller(demos: Demos, epochs: int) -> None:
    train_controller(ControllerConfig(epochs=epochs), demos, "calibration")


def _fit_prices(task: str, name: str) -> Iterator[Price]:
    layout, (_, validation) = get_task(task).layout, split(load_demos(get_task(task)))
    for variant in get_method(name).variants:
        method = get_method(name, variant)
        counts = (1,) if method.deterministic else (1, MANY)
        for size, seeds in product(method.sizes, counts):
            config = config_of(method, size, variant)
            epochs = hasattr(config, "epochs")

            def train(demos: Demos, count: int) -> None:
                chosen = replace(config, epochs=count) if epochs else config  # noqa: B023
                method.fit_seeds(chosen, layout, demos, validation, range(1, seeds + 1))  # noqa: B023

            yield Price(task, name, variant, size, seeds, *_training_seconds(task, train, epochs))


def _training_seconds(task: str, train: Train, epochs: bool = True) -> tuple[float, float, float]:
    """The seconds before the first epoch, for each epoch, and for each demonstration in it."""
    training, _ = split(load_demos(get_task(task)))
    few, start, most, count = _seconds(partial(train, training[:FEW], 1)), 0.0, MORE, 1
    if few < LONG:
        first, most = few, MOST
        if epochs:
            few = max((_seconds(partial(train, training[:FEW], 3)) - first) / 2, 1e-4)
            start = max(0.0, first - few)
            count = max(1, min(10, round(LONG / (few * MOST / FEW))))
    many = (_seconds(partial(train, training[:most], count)) - start) / count
    demo = max(0.0, many - few) / (most - FEW)
    return start, max(0.0, few - FEW * demo), demo


def _seconds(work: Callable[[], object]) -> float:
    with threadpool_limits(1):
        began = process_time()
        work()
        return process_time() - began


if __name__ == "__main__":
    found = []
    for price in measure():
        print(price, flush=True)
        found.append(price)
    write_table(found, describe_machine())
