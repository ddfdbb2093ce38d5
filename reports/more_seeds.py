"""The command that adds to a results folder the seeds that its methods lack."""

from collections import Counter
from collections.abc import Collection, Mapping
from pathlib import Path

import pandas as pd

from bench.labels import EXPERT, plain
from bench.parsing import seeds_text
from bench.presets import PRESETS
from reports.pairing import FEWEST, common_seeds, demos_of_expert
from reports.style import ordered
from tasks.masses import NOMINAL
from tasks.registry import TASKS

SIZES = "sizes"
EXPERIMENTS = (SIZES, "success", "ood", "robustness")
"""The experiments that rows tell apart."""


def more_seeds(
    rows: pd.DataFrame, folder: Path, shipped: Collection[str], notes: Collection[str]
) -> str:
    """Returns the command after which all methods have two seeds in common.

    Empty if there is none, since shipped methods share fewer.

    Args:
        rows: as `bench.source.Source.frame` returns them, of the tasks where methods lack seeds.
        folder: of the results.
        shipped: methods with shipped rows, which cannot have more seeds.
        notes: of the results. They tell the preset.
    """
    groups = [
        (str(method), set(seeds))
        for (_, method), seeds in rows.groupby(["task", "method"], sort=False).seed
    ]
    fixed = [seeds for method, seeds in groups if method in shipped]
    possible = common_seeds(fixed) if fixed else set(rows.seed)
    if len(possible) < FEWEST:
        return ""
    held = Counter(seed for _, seeds in groups for seed in seeds)
    wanted = set(sorted(possible, key=lambda seed: (-held[seed], seed))[:FEWEST])
    lacking = dict.fromkeys(method for method, seeds in groups if not seeds >= wanted)
    names = sorted(dict.fromkeys(map(plain, lacking)), key=lambda name: name == EXPERT)
    mine = rows[~rows.method.isin(shipped)]
    options = {
        "seeds": seeds_text(wanted),
        "tasks": ",".join(ordered(rows.task, TASKS)),
        "methods": ",".join(names),
        "out": str(folder),
    }
    words = [f"--{name} {value}" for name, value in options.items()]
    repeated = _repeated(mine[mine.method.isin(lacking)], rows)
    return f"bench run {_preset(episodes_of(mine), notes)} {' '.join(words)}{repeated}"


def episodes_of(rows: pd.DataFrame) -> dict[str, int]:
    """Returns by experiment the most episodes of an evaluation, see `EXPERIMENTS`."""
    chosen = (
        rows.split == "validation",
        (rows.split == "test") & (rows.physics == NOMINAL),
        rows.split == "ood",
        rows.physics != NOMINAL,
    )
    return {
        name: int(rows.episodes[those].max())
        for name, those in zip(EXPERIMENTS, chosen, strict=True)
        if those.any()
    }


def _preset(episodes: Mapping[str, int], notes: Collection[str]) -> str:
    """Returns the preset that gave these episodes, with the options that say what differs.

    Episodes from validation starts tell nothing: several experiments have them.
    """
    told = {name: count for name, count in episodes.items() if name != SIZES}
    known = {
        name: study.episodes
        for name, study in PRESETS.items()
        if study.note in ("", *notes) and told.keys() <= study.episodes.keys()
    }
    alike = [name for name, theirs in known.items() if told.items() <= theirs.items()]
    name = next(iter([*alike, *known]), "paper")
    every = [one for one in PRESETS[name].episodes if one in EXPERIMENTS and one != SIZES]
    some = "" if set(every) == set(told) else f" --experiments {','.join(told)}"
    counts = set(told.values())
    other = f" --episodes {counts.pop()}" if not alike and len(counts) == 1 else ""
    return f"{name}{some}{other}"


def _repeated(mine: pd.DataFrame, rows: pd.DataFrame) -> str:
    """Returns which options of the run must be repeated, since rows do not tell their values."""
    own = demos_of_expert(rows)
    learnt = mine[mine.method != EXPERT]
    places = zip(learnt.task, learnt.pins, learnt.demos_key, strict=True)
    given = {
        "--set": bool((learnt.settings != "").any()),
        "--demos": any(own.get((task, pins), key) != key for task, pins, key in places),
    }
    names = [name for name, there in given.items() if there]
    return f", with {' and '.join(names)} as before" if names else ""
