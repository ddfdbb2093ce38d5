"""Measures the CPU seconds of fits, outside of a run, whose jobs share the processor's caches."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from bench.backend import Call, Listed, Workers, answers, workers
from bench.computing import fit_methods
from bench.doing import say
from bench.interrupts import Interrupts
from bench.isolation import Failure
from bench.results_writer import writing
from bench.spec import EXPERT, VALIDATION, Fit
from bench.training_data import training_demos, validation_demos
from bench.verify import stored_fit
from methods.kodex import LIFTING_VARIANTS
from tasks.data import Demos

REPEATS = 3
EPOCHS_SHARE = 0.05
"""Share of its epochs for which a network is timed: every epoch does the same work."""


def time_fits(folder: Path, report: Callable[[str], None]) -> int:
    """Times the stored fits whose times exhibits show, one after the other; returns their number.

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
            & frame.variant.isin(["described", *LIFTING_VARIANTS])
        ]
        group = ["task", "method", "settings", "variant", "size", "demos", "demos_key"]
        firsts = shown.sort_values("seed").drop_duplicates(group).sort_values(group)
        missing = firsts[firsts.fit_seconds.isna()].to_dict("records")
        timed = 0
        calls = [partial(_call, row) for row in missing]
        with workers(where), Interrupts() as interrupts:
            for index, answer in answers(Listed(calls), where, interrupts):
                row = missing[int(index)]
                label = stored_fit(row).label
                if isinstance(answer.result, Failure):
                    report(f"{label} cannot be timed: {answer.result.reason}")
                else:
                    writer.add_times(row["folder"], answer.result)
                    report(f"{label}: {median(answer.result):.3g} s")
                    timed += 1
            interrupts.check()
    return timed


def _call(row: dict[str, Any]) -> Call:
    fit = stored_fit(row)
    say(f"timing the fit of {fit.label}")
    arguments = (fit, training_demos(fit), validation_demos(fit))
    return f"time {fit.label}", timing_job, arguments


def timing_job(fit: Fit, demos: Demos, validation: Demos) -> list[float]:
    """Returns the CPU seconds of a fit, measured `REPEATS` times.

    A network is timed for a share of its epochs.
    """
    epochs = fit.config.get("epochs", 1)
    timed = max(1, round(EPOCHS_SHARE * epochs))
    config = {**fit.config, "epochs": timed} if "epochs" in fit.config else fit.config
    timed_fit = replace(fit, config=config)
    measured = [fit_methods([timed_fit], demos, validation)[0].seconds for _ in range(REPEATS)]
    return [seconds * epochs / timed for seconds in measured]
