"""Simulated studies whose true rates are known: what `reports.coverage` tries intervals on."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from tasks.data import BoolArray, FloatArray

SHARED_LUCK = 0.3
"""Share of the variance over controllers that all methods of a seed have in common."""
SHARED_DIFFICULTY = 0.5
"""Share of the variance over episodes that is the start's, and so the same for all methods."""
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(101)


@dataclass(frozen=True)
class Scenario:
    """True rates of M methods, and how they vary; all are fractions.

    An episode succeeds where the method's skill exceeds the start's difficulty and some luck, all
    normal. The skill moves with the controller, whose demonstrations it includes, and with the
    seed of the method itself; a rate near 1 can then fall far and rise little.
    """

    name: str
    rates: tuple[float, ...]
    """(M,) mean over all controllers and seeds."""
    controllers: tuple[float, ...]
    """(M,) standard deviation of the rate over controllers."""
    seeds: tuple[float, ...]
    """(M,) standard deviation of the rate over seeds with one controller."""

    @property
    def skills(self) -> FloatArray:
        """(M, 3): the mean skill, and its standard deviations over controllers and seeds."""
        by_cause = zip(self.rates, self.controllers, self.seeds, strict=True)
        return np.array([_skill(*method) for method in by_cause])


SCENARIOS = (
    Scenario("40 and 40", (0.4, 0.4), (0.05, 0.05), (0.03, 0.03)),
    Scenario("65 and 65", (0.65, 0.65), (0.04, 0.03), (0.0, 0.04)),
    Scenario("70 and 70, seeds alike", (0.7, 0.7), (0.0, 0.0), (0.0, 0.0)),
    Scenario("85 and 85", (0.85, 0.85), (0.05, 0.04), (0.0, 0.03)),
    Scenario("85 and 80", (0.85, 0.8), (0.06, 0.04), (0.0, 0.05)),
    Scenario("65 and 65, one varies by 16", (0.65, 0.65), (0.04, 0.03), (0.16, 0.02)),
    Scenario("85 and 85, one varies by 16", (0.85, 0.85), (0.04, 0.03), (0.16, 0.02)),
    Scenario("96 and 80, the other by 18", (0.96, 0.8), (0.03, 0.05), (0.0, 0.18)),
    Scenario("97 and 90", (0.97, 0.9), (0.01, 0.06), (0.01, 0.0)),
    Scenario("95 and 95", (0.95, 0.95), (0.03, 0.03), (0.01, 0.01)),
    Scenario("95 and 95, one varies by 6", (0.95, 0.95), (0.06, 0.01), (0.0, 0.01)),
    Scenario("98 and 98", (0.98, 0.98), (0.03, 0.02), (0.0, 0.01)),
    Scenario("99 and 100", (0.99, 1.0), (0.02, 0.0), (0.0, 0.0)),
    Scenario("99.9 and 99.9", (0.999, 0.999), (0.001, 0.001), (0.0, 0.0)),
)


def repeated(scenario: Scenario, seeds: int, starts: int, rng: np.random.Generator) -> BoolArray:
    """Returns success (M, R, N) where each seed has a controller and starts of its own."""
    mean, over_controllers, over_seeds = scenario.skills.T[..., None]
    own = rng.standard_normal((2, len(mean), seeds))
    skill = mean + over_controllers * _shared(own[0], rng.standard_normal(seeds), SHARED_LUCK)
    return _episodes(skill + over_seeds * own[1], rng.standard_normal((seeds, starts)), rng)


def with_one_controller(
    scenario: Scenario, seeds: int, starts: int, rng: np.random.Generator
) -> BoolArray:
    """Returns success (M, R, N) where all seeds share one controller and all starts."""
    mean, over_controllers, over_seeds = scenario.skills.T[..., None]
    luck = rng.standard_normal((len(mean), 1))
    skill = mean + over_controllers * _shared(luck, rng.standard_normal(1), SHARED_LUCK)
    by_seed = skill + over_seeds * rng.standard_normal((len(mean), seeds))
    return _episodes(by_seed, rng.standard_normal((1, starts)), rng)


def _episodes(skill: FloatArray, difficulty: FloatArray, rng: np.random.Generator) -> BoolArray:
    """Success (M, R, N) by skill (M, R) from starts whose difficulty is (R, N)."""
    luck = rng.standard_normal((*skill.shape, difficulty.shape[1]))
    return _shared(luck, difficulty, SHARED_DIFFICULTY) < skill[..., None]


def _shared(own: FloatArray, common: FloatArray, share: float) -> FloatArray:
    return np.sqrt(1 - share) * own + np.sqrt(share) * common


@cache
def _skill(rate: float, controllers: float, seeds: float) -> tuple[float, float, float]:
    if rate == 1:
        return np.inf, 0.0, 0.0
    causes = [_deviation(rate, spread) for spread in (controllers, seeds)]
    return ndtri(rate) * np.sqrt(1 + np.sum(np.square(causes))), *causes


def _deviation(rate: float, spread: float) -> float:
    """The standard deviation of a skill that gives the rate this spread about its mean."""

    def excess(deviation: float) -> float:
        rates = ndtr(ndtri(rate) * np.sqrt(1 + deviation**2) + deviation * _NODES)
        return float(np.sqrt(_WEIGHTS @ (rates - rate) ** 2 / _WEIGHTS.sum())) - spread

    return float(brentq(excess, 0, 10)) if spread else 0.0
