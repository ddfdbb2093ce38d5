from dataclasses import dataclass

import numpy as np
import pytest

from bench.computing import Evaluated
from bench.controller import ControllerConfig
from bench.controller_kinds import ORIGINAL
from bench.manifest import Wanted
from bench.results import Results
from bench.results_writer import ResultsWriter, writing
from bench.spec import Cell, ControllerSpec, Evaluation, Fit
from tasks.data import Episodes, Starts, generator
from tasks.files import to_bytes

KODEX = {"cutoff": 1.0}


@dataclass(frozen=True)
class Stored:
    """A writer of a results folder that holds one fit and four episodes of it."""

    writer: ResultsWriter
    fit = Fit("door", "kodex", "described", "single", {"observables": 3, **KODEX}, 10, 1, "r")
    other = Fit("door", "kodex", "described", "single", {"observables": 2, **KODEX}, 10, 1, "r")
    """A fit with the same label that is not stored."""
    evaluation = Evaluation("door", "test", controller_key="c")
    controller = ControllerSpec("door", ORIGINAL, ControllerConfig(), 10, "r", 1)
    weights = to_bytes({"koopman": np.arange(6.0).reshape(2, 3)})
    losses = to_bytes({"losses": np.ones(3)})

    @property
    def results(self) -> Results:
        """The folder, read anew."""
        return Results(self.writer.folder)

    @property
    def wanted(self) -> Wanted:
        return self.cell(self.fit, self.evaluation).wanted

    @staticmethod
    def cell(fit: Fit, evaluation: Evaluation, episodes: int = 4) -> Cell:
        return Cell(fit, evaluation, episodes)

    @staticmethod
    def episodes(first: int, last: int) -> Evaluated:
        readings = generator("episodes").standard_normal((last, 69))
        readings[0, 5:] = np.nan
        starts = Starts("door", "test", np.arange(first, last), np.zeros((last - first, 3)))
        success = np.arange(first, last) % 2 == 1
        steps, diverged = np.full(last - first, 69), np.zeros(last - first, bool)
        return Evaluated(
            Episodes(starts, success, diverged, steps, readings[first:]), {"pins": "unpinned"}
        )

    def path(self, pattern: str):
        (found,) = self.writer.folder.glob(pattern)
        return found


@pytest.fixture
def stored(tmp_path):
    with writing(tmp_path / "results") as writer:
        made = Stored(writer)
        writer.ask_for([made.wanted])
        writer.add_fit(made.fit, made.weights, made.losses, {"seconds": 1.5})
        writer.add_episodes(made.fit, made.evaluation, made.episodes(0, 4))
        yield made


def flipped(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


def truncated(content: bytes) -> bytes:
    return content[:-7]


def emptied(content: bytes) -> bytes:
    return b""


@pytest.fixture(params=[flipped, truncated, emptied])
def damage(request):
    """Damages a file, in one of three ways."""

    def change(path):
        path.write_bytes(request.param(path.read_bytes()))

    return change
