"""The jobs of a run: train a controller, fit a method, evaluate a fit.

A job has the keys of the results that it needs and makes, a cost, a call that runs in another
process, and a method that stores its result.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, TypeVar

from bench.backend import Call
from bench.computing import Evaluated, Fitted, evaluate, fit_controllers, fit_methods
from bench.costs import Cost, controller_cost, evaluation_cost, fit_cost
from bench.missing import Missing
from bench.names import evaluation_label
from bench.results import Results
from bench.results_writer import ResultsWriter
from bench.spec import EXPERT, Cell, ControllerSpec, Fit, controller_blocks, seed_blocks
from bench.trained import keep
from bench.training_data import controller_demos, starts_of, training_demos, validation_demos

T = TypeVar("T")


@dataclass(frozen=True)
class ControllerJob:
    """Trains a tracking controller, or several together."""

    specs: tuple[ControllerSpec, ...]
    """They differ only in their seeds and physics."""
    cached: bool
    """Whether the controllers are also stored in the cache."""
    kind: ClassVar = "controllers"
    after: ClassVar[tuple[str, ...]] = ()

    @property
    def label(self) -> str:
        """A name for people; of several controllers, with all seeds of each physics."""
        labels: dict[str, str] = {}
        for spec in self.specs:
            known = labels.get(spec.physics)
            labels[spec.physics] = f"{known},{spec.seed}" if known else spec.label
        return " ".join(labels.values())

    @cached_property
    def makes(self) -> tuple[str, ...]:
        """The keys of the controllers."""
        return tuple(spec.key for spec in self.specs)

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """The keys of the controllers that they start from."""
        return tuple(spec.start.key for spec in self.specs if spec.start)

    @cached_property
    def cost(self) -> Cost:
        """The expected cost on the reference machine."""
        return controller_cost(self.specs)

    def parts(self) -> Sequence["ControllerJob"]:
        """Returns two jobs of half the controllers each; itself if there is one."""
        return [ControllerJob(specs, self.cached) for specs in _halves(self.specs)]

    def call(self, results: Results) -> Call:
        """Returns what to call in the process of the job; makes demonstrations if needed."""
        demos = [controller_demos(spec) for spec in self.specs]
        start = [results.controller_weights(spec.start) for spec in self.specs if spec.start]
        return self.label, fit_controllers, (self.specs, demos, start)

    def store(self, result: Sequence[Fitted], writer: ResultsWriter) -> None:
        """Stores what the call has returned."""
        for spec, made in zip(self.specs, result, strict=True):
            writer.add_controller(spec, made.parameters, made.facts)
            if self.cached:
                keep(spec, made.parameters, made.facts)


@dataclass(frozen=True)
class FitJob:
    """Fits a method, for one seed or several together."""

    fits: tuple[Fit, ...]
    """They differ only in their seeds."""
    after: tuple[str, ...] = ()
    kind: ClassVar = "fits"
    needs: ClassVar[tuple[str, ...]] = ()

    @property
    def label(self) -> str:
        """A name for people; of several fits, with all seeds."""
        return self.fits[0].label + "".join(f",{fit.seed}" for fit in self.fits[1:])

    @cached_property
    def makes(self) -> tuple[str, ...]:
        """The keys of the fits."""
        return tuple(fit.key for fit in self.fits)

    @cached_property
    def cost(self) -> Cost:
        """The expected cost on the reference machine."""
        return fit_cost(self.fits)

    def parts(self) -> Sequence["FitJob"]:
        """Returns two jobs of half the seeds each; itself if there is one seed."""
        return [FitJob(fits, self.after) for fits in _halves(self.fits)]

    def call(self, results: Results) -> Call:
        """Returns what to call in the process of the job; makes demonstrations if needed."""
        demos = [training_demos(fit) for fit in self.fits]
        validation = [validation_demos(fit) for fit in self.fits]
        return self.label, fit_methods, (self.fits, demos, validation)

    def store(self, result: Sequence[Fitted], writer: ResultsWriter) -> None:
        """Stores what the call has returned."""
        for fit, made in zip(self.fits, result, strict=True):
            writer.add_fit(fit, made.parameters, made.diagnostics, made.facts)


@dataclass(frozen=True)
class EvaluationJob:
    """Evaluates a fit from the starts whose episodes are missing."""

    cell: Cell
    kept: int
    """Stored episodes that are kept."""
    wanted: int
    """Episodes after the job."""
    threads: int
    """Threads of the simulator."""
    after: tuple[str, ...] = ()
    kind: ClassVar = "evaluations"

    @property
    def label(self) -> str:
        """A name for people."""
        return evaluation_label(self.cell.fit, self.cell.evaluation.name)

    @cached_property
    def makes(self) -> tuple[str, ...]:
        """The key of the evaluation."""
        return (self.cell.evaluation.key(self.cell.fit),)

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """The keys of the fit, and of the controller if one tracks its motions."""
        controller = self.cell.controller
        return (self.cell.fit.key, *([controller.key] if controller else []))

    @property
    def episodes(self) -> int:
        """Number of episodes that it simulates."""
        return self.wanted - self.kept

    @cached_property
    def cost(self) -> Cost:
        """The expected cost on the reference machine."""
        return evaluation_cost(self.cell.evaluation, self.episodes, self.threads)

    def parts(self) -> Sequence["EvaluationJob"]:
        """Returns itself: its episodes are stored together."""
        return [self]

    def call(self, results: Results) -> Call:
        """Returns what to call in the process of the job."""
        starts = starts_of(self.cell)[self.kept : self.wanted]
        stored = stored_bytes(self.cell, results)
        return self.label, evaluate, (self.cell, starts, self.kept, *stored, self.threads)

    def store(self, result: Sequence[Evaluated], writer: ResultsWriter) -> None:
        """Stores what the call has returned."""
        writer.add_episodes(self.cell.fit, self.cell.evaluation, result[0], self.kept)


def _halves(items: tuple[T, ...]) -> list[tuple[T, ...]]:
    """Two halves; a single item is not divided."""
    half = (len(items) + 1) // 2
    return [part for part in (items[:half], items[half:]) if part]


RunJob = ControllerJob | FitJob | EvaluationJob


def stored_bytes(cell: Cell, results: Results) -> tuple[bytes, bytes]:
    """Returns the stored parameters of a cell's method and weights of its controller.

    Both are empty for the expert, and the second for a method that predicts actions.
    """
    if cell.fit.method == EXPERT:
        return b"", b""
    controller = results.controller_weights(cell.controller) if cell.controller else b""
    return results.parameters(cell.fit), controller


def jobs_of(
    cells: Iterable[Cell],
    missing: Missing,
    threads: int = 1,
    after: Collection[str] = (),
    cached: bool = True,
) -> list[RunJob]:
    """Returns the jobs that make the missing results of cells.

    Args:
        cells: the cells.
        missing: what is missing of them, see `bench.missing.find_missing`.
        threads: simulator threads of an evaluation.
        after: keys of results that decide whether the fits and evaluations are wanted.
        cached: whether controllers are stored in the cache.
    """
    cells, order = list(cells), tuple(sorted(after))
    controllers = {spec.key: spec for cell in cells for spec in cell.controllers}
    fits = {cell.fit.key: cell.fit for cell in cells if cell.fit.method != EXPERT}
    untrained = [spec for key, spec in controllers.items() if key in missing.controllers]
    jobs: list[RunJob] = [
        ControllerJob(tuple(block), cached) for block in controller_blocks(untrained)
    ]
    blocks = seed_blocks(fit for key, fit in fits.items() if key in missing.fits)
    jobs += [FitJob(tuple(block), order) for block in blocks]
    gaps = ((cell, missing.evaluations.get(cell.evaluation.key(cell.fit))) for cell in cells)
    jobs += [EvaluationJob(cell, *gap, threads, order) for cell, gap in gaps if gap]
    return jobs
