"""How long fits take, in CPU seconds, measured apart from a run, whose jobs share the caches."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median

from bench.driver import fit_job, training_demos, validation_demos
from bench.spec import EXPERT, VALIDATION, Fit
from bench.store import Store
from bench.verify import stored_fit
from methods.kodex import LIFTING_VARIANTS

REPEATS = 3
EPOCHS_SHARE = 0.05
"""Share of its epochs over which a network is timed: they all do the same work."""


def time_fits(folder: Path, report: Callable[[str], None]) -> int:
    """Times the stored fits whose times exhibits show, one after the other; returns how many.

    Of fits that differ in their seeds the first is timed, unless its time is stored.

    Args:
        folder: of `bench run`.
        report: is told the label and the seconds of each.

    Raises:
        InputError: there are no results, they are from other demonstrations than this installation
            makes, or another run writes to the folder.
    """
    store = Store(folder)
    with store.locked():
        frame = store.frame()
        shown = frame[
            (frame.split != VALIDATION)
            & (frame.method != EXPERT)
            & frame.variant.isin(["described", *LIFTING_VARIANTS])
        ]
        group = ["task", "method", "variant", "size", "demos"]
        firsts = shown.sort_values("seed").drop_duplicates(group).sort_values(group)
        missing = firsts[firsts.fit_seconds.isna()].to_dict("records")
        for row in missing:
            fit = stored_fit(row)
            seconds = [time_fit(fit) for _ in range(REPEATS)]
            store.add_times(row, seconds)
            report(f"{fit.label}: {median(seconds):.3g} s")
    return len(missing)


def time_fit(fit: Fit) -> float:
    """Returns the CPU seconds that a fit takes; of a network, from a share of its epochs.

    Of a method with seeds it is a half of what two seeds take together: a network that is fitted
    alone has company for the sake of its bits (see `methods.network`), which is no cost of its own.
    """
    seeds = [fit.seed] if fit.build().deterministic else [fit.seed, fit.seed + 1]
    epochs = fit.config.get("epochs", 1)
    timed = max(1, round(EPOCHS_SHARE * epochs))
    config = {**fit.config, "epochs": timed} if "epochs" in fit.config else fit.config
    demos, validation = training_demos(fit), validation_demos(fit)
    fits = [replace(fit, config=config, seed=seed) for seed in seeds]
    _, _, seconds = fit_job(fits, demos, validation)[0]
    return seconds * epochs / timed
