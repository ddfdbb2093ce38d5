"""How often intervals cover the truth: ``python -m reports.coverage FOLDER``, half an hour.

Writes FOLDER/tables/NAME.md for docs/refresh.py, which puts them into docs/statistics.md.
"""

import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from bench.power import detectable_difference, seeds_needed
from reports.multiple import verdict
from reports.seed_statistics import Estimate, Rate, difference, rate
from reports.simulated import SCENARIOS, Scenario, repeated, with_one_controller
from reports.tried_intervals import bootstrap_t, logit_alone, paired_t, percentile_bootstrap, welch
from tasks.data import BoolArray, generator

SEEDS = (3, 5, 10)
STARTS = (1000, 200)
STUDIES = 2000
FEWER_STUDIES = 300
"""Studies of the claim and of the percentile bootstrap, which take longer."""
CONDITIONS = 32
"""Conditions of the claim, with three contrasts each."""
RELEVANT = 0.05
"""Difference that matters to the verdict on the claim."""
Measure = Callable[[Scenario, int, int, int], float]


def covered_differences(scenario: Scenario, seeds: int, starts: int, studies: int) -> float:
    """Returns the share of simulated studies whose interval covers the true difference."""
    true = scenario.rates[0] - scenario.rates[1]
    drawn = _drawn(scenario, seeds, starts, studies)
    return _share(_covers(difference(*both), true) for both in drawn)


def covered_rates(scenario: Scenario, seeds: int, starts: int, studies: int) -> float:
    """Returns the share of simulated studies whose interval covers the true rate of the first."""
    drawn = _drawn(scenario, seeds, starts, studies)
    return _share(_covers(rate(first), scenario.rates[0]) for first, _ in drawn)


def covered_by_bootstrap(scenario: Scenario, seeds: int, starts: int, studies: int) -> float:
    """Returns how often the percentile bootstrap over seeds with one controller covers the truth.

    The truth is the difference over all controllers.
    """
    true = scenario.rates[0] - scenario.rates[1]
    rng = generator("percentile bootstrap", scenario.name, seeds, starts)
    covered = []
    for _ in range(studies):
        left, right = with_one_controller(scenario, seeds, starts, rng)
        low, high = percentile_bootstrap(left, right, rng)
        covered.append(low <= true <= high)
    return _share(covered)


def contradicted(seeds: int, starts: int, studies: int) -> float:
    """Returns how often a claim of 96 contrasts is contradicted while all differences are zero."""
    rng = generator("contradicted", seeds, starts)
    found = (verdict(_level_contrasts(seeds, starts, rng), RELEVANT) for _ in range(studies))
    return _share(one == "contradicted" for one in found)


def _level_contrasts(seeds: int, starts: int, rng: np.random.Generator) -> list[Estimate]:
    """Of a method with three others that do as well, at the lower rate of each scenario."""
    found = []
    for condition in range(CONDITIONS):
        like = SCENARIOS[condition % len(SCENARIOS)]
        level = Scenario(like.name, (min(like.rates),) * 4, like.controllers * 2, like.seeds * 2)
        first, *others = repeated(level, seeds, starts, rng)
        found += [difference(first, other) for other in others]
    return found


def _drawn(scenario: Scenario, seeds: int, starts: int, studies: int) -> Iterator[BoolArray]:
    """Success (2, R, N) of so many simulated studies, the same ones each time."""
    rng = generator("coverage", scenario.name, seeds, starts)
    for _ in range(studies):
        yield repeated(scenario, seeds, starts, rng)


def _covers(found: Rate | Estimate, true: float) -> bool:
    return found.low <= true <= found.high


def _share(holds: Iterable[bool]) -> float:
    return float(np.mean(list(holds)))


def coverage_table(measure: Measure, studies: int = STUDIES) -> pd.DataFrame:
    """Returns a row for each scenario, and a column for each number of starts and seeds."""
    places = [(starts, seeds) for starts in STARTS for seeds in SEEDS]
    found = Parallel(n_jobs=-1)(
        delayed(measure)(scenario, seeds, starts, studies)
        for scenario in SCENARIOS
        for starts, seeds in places
    )
    columns = [f"{seeds} x {starts}" for starts, seeds in places]
    return _named(found, columns)


def tried_table(seeds: int = 5, starts: int = 1000) -> pd.DataFrame:
    """Returns a row for each scenario, and a column for each interval of a difference."""
    found = Parallel(n_jobs=-1)(
        delayed(_tried)(scenario, seeds, starts, STUDIES) for scenario in SCENARIOS
    )
    return _named(found, ["paired t", "Welch", "bootstrap-t", "logit alone", "in use"])


def _tried(scenario: Scenario, seeds: int, starts: int, studies: int) -> list[float]:
    drawn = _drawn(scenario, seeds, starts, studies)
    left, right = np.stack([both.mean(axis=2) for both in drawn], axis=1)
    true = scenario.rates[0] - scenario.rates[1]
    ends = [way(left, right) for way in (paired_t, welch, bootstrap_t, logit_alone)]
    others = [_share((low <= true) & (true <= high)) for low, high in ends]
    return [*others, covered_differences(scenario, seeds, starts, studies)]


def claim_table() -> pd.DataFrame:
    """Returns how often the claim is contradicted, by seeds and starts."""
    found = Parallel(n_jobs=-1)(
        delayed(contradicted)(seeds, starts, FEWER_STUDIES) for starts in STARTS for seeds in SEEDS
    )
    columns = [f"{seeds} x {starts}" for starts in STARTS for seeds in SEEDS]
    shares = [f"{100 * share:.1f}" for share in found]
    return pd.DataFrame([shares], columns=columns)


def detectable_table() -> pd.DataFrame:
    """Returns what numbers of seeds can show, by the standard deviation of a seed's difference."""
    return pd.DataFrame(
        {
            "deviation over seeds": deviation,
            **{
                f"{seeds} seeds": f"{detectable_difference(deviation, seeds):.1f}"
                for seeds in SEEDS
            },
            **{f"seeds for {points}": seeds_needed(points, deviation) for points in (3, 5, 10)},
        }
        for deviation in (2, 3, 4, 5, 6, 8, 16)
    )


def _named(shares: object, columns: list[str]) -> pd.DataFrame:
    """Shares in per cent, a row for each scenario."""
    values = 100 * np.reshape(np.asarray(shares), (len(SCENARIOS), -1))
    percent = pd.DataFrame(values, columns=columns).map("{:.1f}".format)
    percent.insert(0, "true rates [%]", [scenario.name for scenario in SCENARIOS])
    return percent


def main(folder: Path) -> None:
    """Writes all tables."""
    tables = {
        "detectable": detectable_table,
        "coverage_differences": lambda: coverage_table(covered_differences),
        "coverage_rates": lambda: coverage_table(covered_rates),
        "coverage_bootstrap": lambda: coverage_table(covered_by_bootstrap, FEWER_STUDIES),
        "coverage_tried": tried_table,
        "coverage_claim": claim_table,
    }
    place = folder / "tables"
    place.mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        text = table().to_markdown(index=False, disable_numparse=True)
        (place / f"{name}.md").write_text(f"{text}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
