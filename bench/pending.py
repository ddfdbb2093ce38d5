"""What a results folder still lacks of some cells, once what it holds has been checked."""

from collections.abc import Sequence
from dataclasses import dataclass

from bench.costs import Cost, controller_cost, evaluation_cost, fit_cost
from bench.results import Results
from bench.spec import EXPERT, Cell, ControllerSpec, Fit, seed_blocks
from bench.training_data import wanted_episodes


@dataclass(frozen=True)
class Pending:
    """What is missing."""

    controllers: list[ControllerSpec]
    blocks: list[list[Fit]]
    """Fits that one job does."""
    episodes: list[tuple[Cell, int]]
    """Cells with the number of their missing episodes."""

    def costs(self, threads: int = 1) -> dict[str, list[Cost]]:
        """Returns the costs of the jobs by phase, of which each waits for the one before.

        Args:
            threads: of an evaluation.
        """
        return {
            "controllers": [controller_cost(spec) for spec in self.controllers],
            "fits": [fit_cost(block) for block in self.blocks],
            "evaluations": [
                evaluation_cost(cell.evaluation, count, threads) for cell, count in self.episodes
            ],
        }


def pending(results: Results, cells: Sequence[Cell], earlier: Sequence[Cell] = ()) -> Pending:
    """Returns what is missing of cells once the earlier ones are there."""
    known = {cell.fit.key for cell in earlier}
    tracked = {cell.controller.key for cell in earlier if cell.controller}
    evaluated = {_place(cell): wanted_episodes(cell) for cell in earlier}
    fits = {cell.fit.key: cell.fit for cell in cells if cell.fit.method != EXPERT}
    controllers = {cell.controller.key: cell.controller for cell in cells if cell.controller}
    counts = [
        (cell, wanted_episodes(cell) - max(stored, evaluated.get(_place(cell), 0)))
        for cell in cells
        for stored in [results.stored_episodes(cell.wanted)]
    ]
    return Pending(
        [
            spec
            for spec in controllers.values()
            if spec.key not in tracked and not results.has_controller(spec)
        ],
        seed_blocks(
            fit for fit in fits.values() if fit.key not in known and not results.has_fit(fit)
        ),
        [(cell, count) for cell, count in counts if count > 0],
    )


def _place(cell: Cell) -> tuple[str, str]:
    return cell.fit.key, cell.evaluation.name
