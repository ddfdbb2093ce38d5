"""Repeats some stored fits and evaluations on this machine and compares the results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from bench.backend import Workers
from bench.controller import ControllerConfig
from bench.controller_kinds import NO_CONTROLLER
from bench.driver import run_cells
from bench.intervals import mcnemar
from bench.labels import plain
from bench.names import CONDITIONS
from bench.other_kernels import unlike
from bench.provenance import same_bits, software
from bench.results import Results
from bench.same_bits import episodes_differ, first_difference
from bench.source import OUTCOMES, Source
from bench.spec import EXPERT, Cell, ControllerSpec, Evaluation, Fit
from bench.submission import Submission
from tasks.data import generator
from tasks.demos import adopted_path
from tasks.errors import InputError
from tasks.pins import SWITCH, UNPINNED, mark
from tasks.registry import get_task

IDENTICAL, ALIKE, APART = "identical", "cannot be told apart", "told apart"
DIFFERENT = "different bits"
LEVEL = 0.05
"""Probability of telling any evaluation apart while all have the same success."""


@dataclass(frozen=True)
class Verdict:
    """The comparison of a stored evaluation with its repetition."""

    fit: str
    evaluation: str
    episodes: int
    stored: int
    """Successes of the stored episodes."""
    again: int
    """Successes of the repeated episodes."""
    differ: int
    """Episodes whose success, divergence or length differs."""
    p: float
    """Of McNemar's exact test of success start by start, times the number of evaluations."""
    difference: str = ""
    """The first difference between results that must have the same bits, see `bench.same_bits`."""

    @property
    def verdict(self) -> str:
        """Whether the episodes are identical; if not, whether their success can be told apart.

        Results that must have the same bits have no such tolerance.
        """
        if self.difference:
            return DIFFERENT
        if not self.differ:
            return IDENTICAL
        return APART if self.p <= LEVEL else ALIKE


def verify(source: Source, count: int, episodes: int, draw: int, where: Workers) -> list[Verdict]:
    """Repeats some stored evaluations, including their fits, and compares them.

    Args:
        source: the stored results.
        count: number of evaluations, chosen at random.
        episodes: episodes of each evaluation, at most.
        draw: seed of the random choice.
        where: where jobs run.

    Raises:
        InputError: there are no results, or they are from other demonstrations than this
            installation makes.
    """
    rows = source.frame().to_dict("records")
    if not rows:
        raise InputError("there are no evaluations to verify yet: bench status shows the progress")
    order = generator("verify", draw).permutation(len(rows))[:count]
    chosen = [rows[index] for index in sorted(order)]
    cells = [stored_cell(source, row, episodes) for row in chosen]
    with TemporaryDirectory() as place:
        outcome = run_cells(cells, Path(place), where, _given_weights(source, cells))
        if outcome.failed:
            raise InputError("; ".join(outcome.failed))
        return _compare(source, Results(Path(place)), chosen, cells)


def _given_weights(source: Source, cells: Sequence[Cell]) -> dict[str, bytes]:
    """The weights of methods that were not trained, by digest."""
    fits = [cell.fit for cell in cells if cell.fit.weights]
    if fits and not isinstance(source, Results):
        raise InputError(
            f"{fits[0].label} has weights from a file, which packed results do not hold: verify the"
            " results folder of `bench run`"
        )
    return {fit.weights: source.parameters(fit) for fit in fits if isinstance(source, Results)}


def _compare(
    source: Source, again: Results, rows: Sequence[dict[str, Any]], cells: Sequence[Cell]
) -> list[Verdict]:
    verdicts = []
    for row, cell in zip(rows, cells, strict=True):
        new = again.episodes(cell.wanted)
        assert new is not None
        new = new[[*OUTCOMES]]
        old = source.outcomes(row).iloc[: len(new)]
        differ = int(np.any(old.to_numpy() != new.to_numpy(), axis=1).sum())
        before, after = (one.success.to_numpy(bool) for one in (old, new))
        counts = (len(new), int(before.sum()), int(after.sum()), differ)
        p = min(1.0, len(rows) * mcnemar(before, after))
        difference = _difference(source, again, row, cell)
        verdicts.append(Verdict(cell.fit.label, cell.evaluation.name, *counts, p, difference))
    return verdicts


def _difference(source: Source, again: Results, row: Mapping[str, Any], cell: Cell) -> str:
    """The first difference in bits; of packed results in what is kept of their episodes."""
    if isinstance(source, Results):
        return first_difference(source, again, cell.wanted)
    new = again.episodes(cell.wanted)
    if new is None or not same_bits(source.facts(row["folder"]), software()):
        return ""
    found = episodes_differ(source.outcomes(row), new)
    if found or not isinstance(source, Submission) or len(new) < row["episodes"]:
        return found
    return source.difference(row, again)


def stored_cell(source: Source, row: Mapping[str, Any], episodes: int) -> Cell:
    """Returns the cell of a row of `Source.frame`, with at most a number of episodes.

    Raises:
        InputError: it is from other demonstrations than this installation makes.
    """
    fit = stored_fit(row)
    conditions = (*CONDITIONS, "controller_key")
    evaluation = Evaluation(fit.task, **{name: row[name] for name in conditions})
    controller = None
    if evaluation.controller != NO_CONTROLLER:
        controller = stored_controller(source.controller_spec(evaluation.controller_key))
    return Cell(fit, evaluation, min(episodes, row["episodes"]), controller)


def stored_controller(spec: Mapping[str, Any]) -> ControllerSpec:
    """Returns the controller with the fields of `Source.controller_spec`."""
    config = spec["config"] | {"hidden": tuple(spec["config"]["hidden"])}
    start = spec.get("start")
    values = {"config": ControllerConfig(**config), "start": start and stored_controller(start)}
    return ControllerSpec(**{**spec, **values})


def stored_fit(row: Mapping[str, Any]) -> Fit:
    """Returns the fit of a row of `Source.frame`.

    Raises:
        InputError: it is from other demonstrations than this installation makes, or of kernels
            that are not those of this process.
    """
    fit = fit_of(row)
    kept = fit.method != EXPERT and adopted_path(get_task(fit.task), fit.demos_key).exists()
    if not (fit.of_expert or kept):
        raise InputError(
            f"{fit.label} learnt from other demonstrations than this installation makes: the"
            " expert, the task, the version of MuJoCo or the kernels that recorded them differ (its"
            f" kernels: {fit.pins})"
        )
    if fit.pins != mark():
        switch = f": set {SWITCH}=off" if fit.pins == UNPINNED else ""
        raise InputError(f"{fit.label} is a result of {unlike([fit.pins])}{switch}")
    return fit


def fit_of(row: Mapping[str, Any]) -> Fit:
    """Returns the fit of a row of `Source.frame`, labelled or not, without checks."""
    values = {field.name: row[field.name] for field in fields(Fit)}
    return Fit(**values | {"method": plain(row["method"])})
