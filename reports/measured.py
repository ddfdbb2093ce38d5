"""What results say of a statement: its number, with an interval and a p-value."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial, singledispatch
from typing import NamedTuple

import numpy as np
import pandas as pd

from bench.selection import SIZES
from reports.at_least import corrections, kth_largest
from reports.claim import (
    ERROR,
    SUCCESS,
    TIME,
    AtLeast,
    Contrast,
    LargestAboveOne,
    MostBelowOne,
    Overall,
    SeedMatters,
    Setting,
    SizeMatters,
    Statement,
    TrainsLonger,
    Trend,
)
from reports.diagnostics import imitation_error, magnitudes
from reports.exhibits.table_11 import SETS
from reports.results import Results
from reports.seed_statistics import (
    Estimate,
    aggregate,
    difference,
    mean_of,
    rank_correlation,
)
from reports.style import display
from tasks.data import BoolArray, FloatArray
from tasks.registry import TASKS

TIMED = "fits of one seed are timed"
FEWEST_SPREADS = 3
"""The fewest seeds whose spread has an interval."""
Pair = tuple[BoolArray, BoolArray]


class NotRunError(Exception):
    """Results lack what a statement is about. The message says what."""


class Measured(NamedTuple):
    """A statement, its name in full, and its number in results, in the statement's unit."""

    statement: Statement
    name: str
    found: Estimate

    @property
    def above_margin(self) -> float:
        """How far the number exceeds the margin."""
        return self.found.value - self.found.margin

    def __str__(self) -> str:
        statement, found = self.statement, self.found
        ends = (format(end, statement.form.removeprefix("+")) for end in (found.low, found.high))
        interval = f" [{', '.join(ends)}]" if found.low < found.high else ""
        return (
            f"{self.name}: {found.value:{statement.form}}{statement.unit}{interval},"
            f" claimed above {found.margin:g}"
        )


@singledispatch
def measure(statement: Statement, results: Results) -> Measured:
    """Returns what results say of a statement.

    Raises:
        NotRunError: they lack what it is about.
    """
    raise TypeError(f"no way to measure {statement}")


@measure.register
def _(statement: Contrast, results: Results) -> Measured:
    ((left, right),) = _paired([(statement.left, statement.right)], results)
    found = difference(left, right, statement.margin / 100)
    return Measured(statement, str(statement), _in_points(found))


@measure.register
def _(statement: Overall, results: Results) -> Measured:
    found = aggregate(_paired(statement.pairs, results), statement.margin / 100)
    return Measured(statement, str(statement), _in_points(found))


@measure.register
def _(statement: AtLeast, results: Results) -> Measured:
    contrasts, margin = statement.contrasts, statement.margin / 100
    pairs = [_paired([(one.left, one.right)], results)[0] for one in contrasts]
    lower, upper = (
        [_in_points(difference(*pair, margin, number)) for pair in pairs]
        for number in corrections(len(pairs), statement.count)
    )
    falling = np.argsort([-one.value for one in lower], kind="stable")
    deciding = contrasts[falling[statement.count - 1]]
    found = kth_largest(lower, upper, statement.count)
    return Measured(statement, f"{statement}, {deciding}", found)


@measure.register
def _(statement: SizeMatters, results: Results) -> Measured:
    pairs = [_best_and_worst(statement.method, task, results) for task in TASKS]
    found = aggregate(_cut(pairs), statement.margin / 100)
    return Measured(statement, str(statement), _in_points(found))


def _best_and_worst(method: str, task: str, results: Results) -> Pair:
    """Success (R, N) of the sizes that do best and worst with the other seeds than each."""
    here = {"method": method, "task": task, "split": "validation"}
    rows = [results.rows.main(size=size, **here) for size in SIZES]
    found = [one for one in results.episodes.of_selections(rows) if one is not None]
    if len(found) < 2:
        raise NotRunError(f"no two sizes of {display(method)} on {display(task)}")
    success = np.stack(found)
    seeds = success.shape[1]
    if seeds == 1:
        raise NotRunError("one seed: other seeds must choose the best size")
    rates = success.mean(axis=2)
    others = rates.sum(axis=1, keepdims=True) - rates
    each = np.arange(seeds)
    return success[others.argmax(axis=0), each], success[others.argmin(axis=0), each]


@measure.register
def _(statement: SeedMatters, results: Results) -> Measured:
    pairs = [(Setting(statement.method, task), Setting("kodex", task)) for task in TASKS]
    success = np.array(_paired(pairs, results))
    rates, starts = success.mean(axis=-1), success.shape[-1]
    seeds = rates.shape[-1]
    if seeds < FEWEST_SPREADS:
        raise NotRunError(f"a spread over seeds takes {FEWEST_SPREADS} seeds, there are {seeds}")
    spread = _mean_spread(rates, starts)
    without = [_mean_spread(np.delete(rates, seed, axis=-1), starts) for seed in range(seeds)]
    jackknifed = seeds * spread - (seeds - 1) * np.array(without)
    return Measured(statement, str(statement), _over_seeds(jackknifed, statement.margin))


def _mean_spread(rates: FloatArray, starts: int) -> float:
    """The standard deviation over seeds [points], left minus right, of rates (K, 2, R).

    The part that so many starts a seed have of themselves is left out: it is larger at 50% than
    near 100%, whatever the methods.
    """
    of_starts = (rates * (1 - rates) / (starts - 1)).mean(axis=-1)
    variances = np.maximum(rates.var(axis=-1, ddof=1) - of_starts, 0)
    left, right = 100 * np.sqrt(variances).mean(axis=0)
    return float(left - right)


@measure.register
def _(statement: Trend, results: Results) -> Measured:
    values = _QUANTITIES[statement.quantity](results)
    found = rank_correlation(np.arange(len(SETS)), values if statement.rises else -values)
    if statement.quantity == TIME:
        found = found._replace(basis=TIMED)
    return Measured(statement, str(statement), found)


def _success_by_set(results: Results) -> FloatArray:
    """Success (R, K, L) of each seed, task and set."""
    settings = [[Setting("kodex", task, variant=v) for v in SETS] for task in TASKS]
    found = [np.stack(_success(one, results)).mean(axis=2).T for one in settings]
    seeds = min(map(len, found))
    return np.stack([one[:seeds] for one in found], axis=1)


def _error_by_set(results: Results) -> FloatArray:
    """Imitation errors (R, K, L) of each seed, task and set."""
    errors = []
    for task in TASKS:
        fits = [_fits(results, task, variant).set_index("seed").folder for variant in SETS]
        common = pd.concat(fits, axis=1, join="inner").sort_index()
        errors.append(common.map(partial(imitation_error, results)).to_numpy(float))
    seeds = min(map(len, errors))
    if not seeds:
        raise NotRunError("the sets of observables have no seed in common")
    return np.stack([one[:seeds] for one in errors], axis=1)


def _time_by_set(results: Results) -> FloatArray:
    """Seconds (1, K, L) to fit K, of one seed for each task and set."""
    return np.array(
        [[[_seconds(results, "kodex", task, variant) for variant in SETS] for task in TASKS]]
    )


_QUANTITIES: dict[str, Callable[[Results], FloatArray]] = {
    SUCCESS: _success_by_set,
    ERROR: _error_by_set,
    TIME: _time_by_set,
}


@measure.register
def _(statement: MostBelowOne, results: Results) -> Measured:
    below = [100 * (one < 1).mean() for one in _magnitudes(results, statement.task)]
    return Measured(statement, str(statement), _over_seeds(below, statement.margin))


@measure.register
def _(statement: LargestAboveOne, results: Results) -> Measured:
    largest = [one.max() for one in _magnitudes(results, statement.task)]
    return Measured(statement, str(statement), _over_seeds(largest, statement.margin))


def _magnitudes(results: Results, task: str) -> list[FloatArray]:
    """The eigenvalue magnitudes of K for each seed of KODex."""
    return [magnitudes(results, row) for row in _fits(results, task).to_dict("records")]


@measure.register
def _(statement: TrainsLonger, results: Results) -> Measured:
    own, kodex = (_seconds(results, m, statement.task) for m in (statement.method, "kodex"))
    ratio, margin = own / kodex, statement.margin
    p = float(ratio == margin)
    found = Estimate(ratio, ratio, ratio, p, margin, 1, TIMED)
    return Measured(statement, str(statement), found)


def _over_seeds(values: Sequence[float] | FloatArray, margin: float) -> Estimate:
    """The mean of one number for each seed."""
    if len(values) == 1:
        raise NotRunError("one seed, which shows no spread over seeds")
    return mean_of(values, margin)


def _fits(results: Results, task: str, variant: str = "described") -> pd.DataFrame:
    """One row for each seed of KODex."""
    found = results.rows.main(method="kodex", task=task, variant=variant).drop_duplicates("seed")
    if found.empty:
        raise NotRunError(f"no results of {Setting('kodex', task, variant=variant)}")
    return found.sort_values("seed")


def _seconds(results: Results, method: str, task: str, variant: str = "described") -> float:
    """The training time of the first seed that was timed."""
    found = results.rows.main(method=method, task=task, variant=variant, split="test")
    timed = found.dropna(subset="fit_seconds")
    if timed.empty:
        raise NotRunError(f"no training time of {Setting(method, task, variant=variant)}")
    return float(timed.fit_seconds.iloc[0])


def _paired(pairs: Sequence[tuple[Setting, Setting]], results: Results) -> list[Pair]:
    """Success (R, N) of both sides of each pair, on as many seeds and starts for all of them."""
    settings = dict.fromkeys(side for pair in pairs for side in pair)
    found: dict[Setting, BoolArray] = {}
    for task in dict.fromkeys(one.task for one in settings):
        here = [one for one in settings if one.task == task]
        found |= zip(here, _success(here, results), strict=True)
    return _cut([(found[left], found[right]) for left, right in pairs])


def _success(settings: Sequence[Setting], results: Results) -> list[BoolArray]:
    """Success (R, N) of settings of one task, on their common seeds and starts."""
    rows = results.rows
    selected = rows.at_one_size([rows.select(**_selection(setting)) for setting in settings])
    found = results.episodes.of_selections(selected)
    shown = []
    for setting, part, success in zip(settings, selected, found, strict=True):
        if success is None:
            lacking = "results" if part.empty else "common seed"
            raise NotRunError(f"no {lacking} of {setting}")
        shown.append(success)
    return shown


def _cut(pairs: Sequence[Pair]) -> list[Pair]:
    """The pairs of several tasks, cut to the fewest seeds and starts among them."""
    seeds, starts = np.min([left.shape for left, _ in pairs], axis=0)
    return [(left[:seeds, :starts], right[:seeds, :starts]) for left, right in pairs]


def _selection(setting: Setting) -> dict[str, str]:
    """Returns the values that select a setting's evaluations."""
    names: Iterable[str] = ("method", "task", "split", "physics", "variant", "controller")
    return {name: getattr(setting, name) for name in names}


def _in_points(found: Estimate) -> Estimate:
    value, low, high, margin = (
        100 * one for one in (found.value, found.low, found.high, found.margin)
    )
    return found._replace(value=value, low=low, high=high, margin=margin)
