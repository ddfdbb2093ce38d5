"""Measures the CPU seconds of fits and actions, outside of a run, whose jobs share caches."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any, NamedTuple

from bench.backend import Call, Listed, Workers, answers, workers
from bench.computing import Fitted, fit_methods
from bench.doing import say
from bench.interrupts import Interrupts
from bench.isolation import Failure
from bench.results_writer import writing
from bench.spec import EXPERT, VALIDATION, Fit
from bench.stored_files import Times
from bench.training_data import training_demos, validation_demos
from bench.verify import stored_fit
from methods.base import Method
from methods.contract import loaded
from methods.kodex import LIFTING_VARIANTS
from methods.registry import get_method
from methods.toy import answer
from tasks.data import Demos
from tasks.registry import get_task

REPEATS = 3
EPOCHS_SHARE = 0.05
"""Share of its epochs for which a network is timed: every epoch does the same work."""
FEWEST = 2
"""Epochs at least for which it is timed: what a fit costs besides is told from one epoch."""


class Timed(NamedTuple):
    """How many fits were timed, and the labels of those that could not be, with the reason."""

    done: int
    failed: list[str]


def time_fits(folder: Path, report: Callable[[str], None]) -> Timed:
    """Times the stored fits whose times exhibits show, one after the other.

    Of fits that differ only in their seeds, the first is timed, unless its time is stored already.

    Args:
        folder: results folder of `bench run`.
        report: is called with a line for each fit: its label and seconds.

    Raises:
        InputError: there are no results, they are from other demonstrations than this installation
            makes, or another run writes to the folder.
    """
    where = Workers(1)
    with writing(folder) as writer:
        frame = writer.results.frame()
        shown = frame[
            (frame.split != VALIDATION)
            & (frame.method != EXPERT)
            & (frame.weights == "")
            & frame.variant.isin(["described", *LIFTING_VARIANTS])
        ]
        group = [
            *("task", "method", "settings", "variant", "size"),
            *("demos", "held_out", "demos_key"),
        ]
        firsts = shown.sort_values("seed").drop_duplicates(group).sort_values(group)
        missing = firsts[firsts.fit_seconds.isna()].to_dict("records")
        timed, failed = 0, []
        calls = [partial(_call, row) for row in missing]
        with workers(where), Interrupts() as interrupts:
            for index, answer in answers(Listed(calls), where, interrupts):
                row = missing[int(index)]
                label = stored_fit(row).label
                if isinstance(answer.result, Failure):
                    failed.append(f"{label}: {answer.result.reason}")
                else:
                    writer.add_times(row["folder"], answer.result)
                    fit, action = map(median, answer.result)
                    report(f"{label}: {fit:.3g} s, an action {1e6 * action:.3g} µs")
                    timed += 1
            interrupts.check()
    return Timed(timed, failed)


def _call(row: dict[str, Any]) -> Call:
    fit = stored_fit(row)
    say(f"timing the fit of {fit.label}")
    arguments = (fit, training_demos(fit), validation_demos(fit))
    return f"time {fit.label}", timing_job, arguments


def timing_job(fit: Fit, demos: Demos, validation: Demos) -> Times:
    """Returns the CPU seconds of a fit and of an action, each measured `REPEATS` times.

    A network is timed for one epoch and for a share of its epochs; each further epoch costs the
    same.
    """
    epochs = fit.config.get("epochs", 1)
    few = min(epochs, max(FEWEST, round(EPOCHS_SHARE * epochs)))

    def fitted(count: int) -> Fitted:
        config = {**fit.config, "epochs": count} if "epochs" in fit.config else fit.config
        return fit_methods([replace(fit, config=config)], [demos], [validation])[0]

    seconds = []
    for _ in range(REPEATS):
        one = last = fitted(1)
        if few > 1:
            last = fitted(few)
        each = (last.seconds - one.seconds) / max(few - 1, 1)
        seconds.append(last.seconds + each * (epochs - few))
    made, layout = get_method(fit.method, fit.variant), get_task(fit.task).layout
    method, episode = loaded(made, fit.config, layout, last.parameters), demos[:1]
    steps = episode.actions.shape[1]
    return Times(seconds, [_answer_seconds(method, episode) / steps for _ in range(REPEATS)])


def _answer_seconds(method: Method, episode: Demos) -> float:
    """The CPU seconds of what a method answers in an episode, without the controller."""
    began = process_time()
    answer(method, episode)
    return process_time() - began
