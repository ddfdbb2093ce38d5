"""What rates vary with, estimated from stored episodes: the controller, the seed, the start."""

from itertools import combinations

import numpy as np
import pandas as pd

from bench.controller_kinds import ORIGINAL
from reports.style import METHODS, TASKS
from tasks.data import FloatArray
from tasks.registry import APPENDIX


def deviation(values: FloatArray) -> float:
    """Returns the standard deviation of a rate over levels, less what the luck of starts adds.

    The estimate is that of the analysis of variance of two factors, levels and starts, without
    repetition (Searle, Casella and McCulloch 1992, section 4.3); 0 where it would be negative.

    Args:
        values: (L, N) of each level (such as a controller) from the same starts: success, or a
            difference of two successes.
    """
    levels, starts = values.shape
    by_level, by_start = values.mean(axis=1, keepdims=True), values.mean(axis=0)
    rest = values - by_level - by_start + values.mean()
    noise = (rest**2).sum() / ((levels - 1) * (starts - 1))
    return float(np.sqrt(max(by_level.var(ddof=1) - noise / starts, 0.0)))


def components(episodes: pd.DataFrame) -> pd.DataFrame:
    """Returns the deviations of the difference of each two methods on each task.

    Columns: ``task``, ``left``, ``right``, ``controller`` and ``seed``, standard deviations in
    points over controllers and over seeds with the original controller, and ``start``, the
    correlation of the two methods' success over starts.

    Args:
        episodes: those of `bench.load`. A method at the size that was evaluated with several
            controllers counts, from the starts of test that all its evaluations have.
    """
    kept = episodes[
        (episodes.split == "test")
        & (episodes.physics == "nominal")
        & (episodes.variant == "described")
        & (episodes.rule == APPENDIX)
        & episodes.controller.astype(str).str.startswith(ORIGINAL)
        & episodes.method.isin(METHODS[1:])
    ].astype({name: str for name in ("task", "method", "size", "controller")})
    rows = []
    for task in TASKS:
        crossed = {
            method: _crossed(kept[(kept.task == task) & (kept.method == method)])
            for method in METHODS[1:]
        }
        there = {method: cubes for method, cubes in crossed.items() if cubes}
        rows += [
            {"task": task, "left": left, "right": right} | _of_pair(there[left], there[right])
            for left, right in combinations(there, 2)
        ]
    return pd.DataFrame(rows)


def _crossed(mine: pd.DataFrame) -> tuple[FloatArray, FloatArray] | None:
    """Success (C, S, N) with all controllers, and (1, S, N) with the original; None without."""
    others = mine[mine.controller != ORIGINAL]
    same = mine[mine["size"].isin(others["size"].unique()) & (mine.demos == mine.demos.max())]
    return (_cube(same), _cube(same[same.controller == ORIGINAL])) if len(others) else None


def _cube(mine: pd.DataFrame) -> FloatArray:
    """Success (C, S, N) of the seeds and starts that all controllers have."""
    seeds = set.intersection(*mine.groupby("controller").seed.agg(set))
    wide = (
        mine[mine.seed.isin(seeds)]
        .astype({"success": float})
        .pivot(index="start", columns=["controller", "seed"], values="success")
    )
    whole = wide.dropna().sort_index(axis="columns").to_numpy()
    return whole.T.reshape(-1, len(seeds), len(whole))


def _of_pair(
    left: tuple[FloatArray, FloatArray], right: tuple[FloatArray, FloatArray]
) -> dict[str, float]:
    by_controller, by_seed = (
        one[..., :starts] - other[..., :starts]
        for one, other in zip(left, right, strict=True)
        for starts in [min(one.shape[-1], other.shape[-1])]
    )
    starts = by_seed.shape[-1]
    pairs = np.broadcast_arrays(left[1][0, :, :starts], right[1][0, :, :starts])
    alike = [
        np.corrcoef(one, other)[0, 1]
        for one, other in zip(*pairs, strict=True)
        if one.std() and other.std()
    ]
    return {
        "controller": 100 * deviation(by_controller.mean(axis=1)),
        "seed": 100 * deviation(by_seed[0]),
        "start": float(np.mean(alike)) if alike else np.nan,
    }
