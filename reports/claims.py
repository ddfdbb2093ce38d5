"""The claims of the paper, as statements that numbers can decide, and two verdicts for each.

Each claim was written down before this suite had results that decide it. It is a list of contrasts
"left minus right is above a margin". In the paper's own tables a claim holds if all its contrasts
hold for the printed numbers. In ours, a claim is

- reproduced, if the whole interval of every contrast lies on the claimed side;
- contradicted, if the whole interval of some contrast lies on the other side;
- undecided else; not run, where results are missing; failed, where they cannot be read.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np
import pandas as pd

from reports import figure_6, figure_6_time
from reports.paper import published
from reports.results import Results
from reports.stats import paired_difference
from reports.style import METHODS, TASKS, display
from reports.table_11 import SETS
from reports.table_12 import magnitudes
from tasks.errors import described
from tasks.masses import VARIATIONS
from tasks.words import count_of

ROBUSTNESS_TABLES = dict(zip(TASKS, (7, 8, 9, 10), strict=True))
FAILED = "failed"
SIMILAR = 5.0
"""Points of success within which two are called comparable, or about the same."""
BASELINES = METHODS[2:]
LEARNERS = METHODS[1:]


@dataclass(frozen=True)
class Setting:
    """Where a success rate is measured."""

    method: str
    task: str
    split: str = "test"
    physics: str = "nominal"
    tuned: bool = False
    variant: str = "described"

    def __str__(self) -> str:
        parts = [display(self.method), display(self.task)]
        parts += [self.split] if self.split != "test" else []
        parts += [display(self.physics)] if self.physics != "nominal" else []
        parts += ["tuned"] if self.tuned else []
        parts += [display(self.variant)] if self.variant != "described" else []
        return " ".join(parts)


@dataclass(frozen=True)
class Contrast:
    """Left minus right is above the margin, in points of success."""

    left: Setting
    right: Setting
    margin: float = 0.0


@dataclass(frozen=True)
class Claim:
    """One sentence of the appendix, in contrasts."""

    name: str
    says: str
    source: str
    contrasts: tuple[Contrast, ...]


Measured = tuple[Contrast, float, float, float]
"""A contrast, its difference in points, and the ends of its interval."""


def _about_the_same(left: Setting, right: Setting) -> tuple[Contrast, Contrast]:
    return Contrast(left, right, -SIMILAR), Contrast(right, left, -SIMILAR)


def _varied(method: str, task: str, physics: str, tuned: bool = False) -> Setting:
    tuned = tuned and method != "expert"
    return Setting(method, task, physics=physics, tuned=tuned)


OTHER_TASKS = TASKS[1:]
CLAIMS = (
    Claim(
        "kodex-ood-tool",
        "Out of distribution, KODex outperforms the four baselines on Tool.",
        "H",
        tuple(
            Contrast(Setting("kodex", "tool", "ood"), Setting(m, "tool", "ood")) for m in BASELINES
        ),
    ),
    Claim(
        "ngf-ood",
        "Out of distribution, NGF performs best of the methods on the other tasks.",
        "H",
        tuple(
            Contrast(Setting("ngf", task, "ood"), Setting(m, task, "ood"))
            for task in OTHER_TASKS
            for m in LEARNERS
            if m != "ngf"
        ),
    ),
    Claim(
        "kodex-ood-comparable",
        "Out of distribution, KODex is comparable to NDP and LSTM on the other tasks"
        f" (within {SIMILAR:g} points).",
        "H",
        tuple(
            contrast
            for task in OTHER_TASKS
            for m in ("ndp", "lstm")
            for contrast in _about_the_same(Setting("kodex", task, "ood"), Setting(m, task, "ood"))
        ),
    ),
    Claim(
        "light-hand-costs-least",
        "With the original controller, no variation leaves a method more success than Light Hand"
        f" (by {SIMILAR:g} points or more).",
        "I",
        tuple(
            Contrast(_varied(m, task, "light_hand"), _varied(m, task, other), -SIMILAR)
            for task in TASKS
            for m in LEARNERS
            for other in VARIATIONS
            if other != "light_hand"
        ),
    ),
    Claim(
        "light-hand-no-gain",
        f"In Light Hand, the tuned controller adds no considerable success (under {SIMILAR:g}"
        " points).",
        "I",
        tuple(
            Contrast(_varied(m, task, "light_hand"), _varied(m, task, "light_hand", True), -SIMILAR)
            for task in TASKS
            for m in LEARNERS
        ),
    ),
    Claim(
        "heavy-hand-gain",
        "In Heavy Hand, every method benefits from the tuned controller.",
        "I",
        tuple(
            Contrast(_varied(m, task, "heavy_hand", True), _varied(m, task, "heavy_hand"))
            for task in TASKS
            for m in LEARNERS
        ),
    ),
    Claim(
        "kodex-robust",
        "In changed physics, KODex outperforms NN, LSTM and NDP.",
        "I",
        tuple(
            Contrast(_varied("kodex", task, v, tuned), _varied(m, task, v, tuned))
            for task in TASKS
            for v in VARIATIONS
            for tuned in (False, True)
            for m in ("nn", "lstm", "ndp")
        ),
    ),
    Claim(
        "kodex-above-expert-relocation",
        "In Heavy Object on Relocation, KODex with the original controller outperforms the expert.",
        "I",
        (
            Contrast(
                _varied("kodex", "relocation", "heavy_object"),
                _varied("expert", "relocation", "heavy_object"),
            ),
        ),
    ),
    Claim(
        "kodex-above-expert-door",
        "In Heavy Object on Door, KODex with the original controller outperforms the expert.",
        "I",
        (
            Contrast(
                _varied("kodex", "door", "heavy_object"), _varied("expert", "door", "heavy_object")
            ),
        ),
    ),
    Claim(
        "sets-alike",
        f"The second, third and fourth set of observables succeed about as often (within"
        f" {SIMILAR:g} points).",
        "J",
        tuple(
            contrast
            for task in TASKS
            for one, other in combinations(("set_2", "described", "set_4"), 2)
            for contrast in _about_the_same(
                Setting("kodex", task, variant=one), Setting("kodex", task, variant=other)
            )
        ),
    ),
    Claim(
        "set-2-relocation",
        "On Relocation, KODex does marginally better with set 2 than with set 3.",
        "J",
        (
            Contrast(
                Setting("kodex", "relocation", variant="set_2"), Setting("kodex", "relocation")
            ),
        ),
    ),
)


def most_magnitudes_below_one(results: Results) -> tuple[str, str]:
    """Most eigenvalue magnitudes of K are below one, and a few are above."""
    found = magnitudes(results)
    if set(found) != set(TASKS):
        return "not run", "not all tasks have a KODex"
    above = {task: float((values > 1).mean()) for task, values in found.items()}
    holds = all(0 < share < 0.5 for share in above.values())
    shares = ", ".join(f"{display(task)} {100 * share:.1f}%" for task, share in above.items())
    return "reproduced" if holds else "contradicted", f"above one: {shares}"


def error_falls_with_observables(results: Results) -> tuple[str, str]:
    """The more observables, the smaller the imitation error."""
    table = figure_6.table(results)
    return _along_sets(table[table.row.str.endswith(figure_6.ERROR)], -1)


def time_grows_with_observables(results: Results) -> tuple[str, str]:
    """The more observables, the longer the fit."""
    return _along_sets(figure_6_time.table(results), 1)


def trains_in_a_tenth_of_the_time(results: Results) -> tuple[str, str]:
    """KODex takes about a tenth of the training time of each baseline (at most a third)."""
    timed = results.main(split="test").dropna(subset="fit_seconds")
    seconds = timed.drop_duplicates(["method", "task"]).pivot(
        index="method", columns="task", values="fit_seconds"
    )
    seconds = seconds.reindex(index=LEARNERS, columns=TASKS)
    if seconds.isna().any(axis=None):
        return "not run", "not all methods have been timed on all tasks"
    ratios = seconds.loc[list(BASELINES)] / seconds.loc["kodex"]
    verdict = "reproduced" if (ratios >= 3).all(axis=None) else "contradicted"
    ranges = [f"{display(m)} {row.min():.0f} to {row.max():.0f}" for m, row in ratios.iterrows()]
    return verdict, f"times as long as KODex: {', '.join(ranges)}"


FACTS: dict[str, tuple[Callable[[Results], tuple[str, str]], str, str]] = {
    "magnitudes-below-one": (
        most_magnitudes_below_one,
        "appendix J",
        "holds (Table 12; Fig. 7 is a picture)",
    ),
    "error-falls": (error_falls_with_observables, "appendix J", "published as a figure only"),
    "time-grows": (time_grows_with_observables, "appendix J", "published as a figure only"),
    "trains-faster": (trains_in_a_tenth_of_the_time, "abstract", "no numbers in the appendix"),
}
"""Claims about single numbers, not about success, their source and whether the paper's own hold."""


def _along_sets(chosen: pd.DataFrame, sign: int) -> tuple[str, str]:
    rising = {}
    for task, part in chosen.groupby("column", sort=False):
        rising[task] = bool((np.diff(part.value) * sign > 0).all())
    if set(rising) != set(TASKS) or len(chosen) < len(TASKS) * len(SETS):
        return "not run", "not all sets have been run on all tasks"
    failing = [display(task) for task, holds in rising.items() if not holds]
    verdict = "contradicted" if failing else "reproduced"
    return verdict, f"not from set to set on: {', '.join(failing)}" if failing else "on all tasks"


def verdicts(results: Results) -> pd.DataFrame:
    """Returns one row a claim: what it says, its source, whether it holds in the paper and here.

    ``evidence`` names the contrast that decides, or comes nearest to deciding, ours.
    """
    rows = []
    for claim in CLAIMS:
        ours, evidence = _attempted(partial(_ours, claim), results)
        rows.append(
            {
                "claim": claim.name,
                "says": claim.says,
                "source": f"appendix {claim.source}",
                "paper": _in_paper(claim),
                "ours": ours,
                "evidence": evidence,
            }
        )
    for name, (fact, source, paper) in FACTS.items():
        verdict, evidence = _attempted(fact, results)
        says = (fact.__doc__ or "").strip()
        row = {"claim": name, "says": says, "source": source, "paper": paper}
        rows.append(row | {"ours": verdict, "evidence": evidence})
    return pd.DataFrame(rows)


def _attempted(decide: Callable[[Results], tuple[str, str]], results: Results) -> tuple[str, str]:
    """The verdict and its evidence; of a claim that cannot be decided for an error, that error."""
    try:
        return decide(results)
    except Exception as error:
        return FAILED, described(error)


def _in_paper(claim: Claim) -> str:
    """Whether all contrasts hold for the numbers that the paper prints."""
    pairs = [(_printed(c.left), _printed(c.right), c) for c in claim.contrasts]
    known = [(left, right, c) for left, right, c in pairs if np.isfinite(left - right)]
    if not known:
        return "published as a figure only"
    failing = [
        f"{c.left} {left:g}, {c.right} {right:g}"
        for left, right, c in known
        if left - right <= c.margin
    ]
    compared = count_of(len(known), "comparison")
    if not failing:
        return f"holds in {len(known)} of {compared}"
    return f"fails in {len(failing)} of {compared}, as in: {failing[0]}"


def _printed(setting: Setting) -> float:
    if setting.physics == "nominal" or setting.variant != "described":
        return np.nan
    table = published(f"table_{ROBUSTNESS_TABLES[setting.task]}")
    controller = "tuned" if setting.tuned else "original"
    row = setting.method if setting.method == "expert" else f"{setting.method} {controller}"
    found = table[(table.row == row) & (table.column == setting.physics)].value
    return float(found.iloc[0]) if len(found) else np.nan


def _ours(claim: Claim, results: Results) -> tuple[str, str]:
    measured: list[Measured] = []
    for contrast in claim.contrasts:
        left, right = results.successes([_at(contrast.left), _at(contrast.right)])
        if left is None or right is None:
            return "not run", f"no results of {contrast.left if left is None else contrast.right}"
        found = paired_difference(left, right, str(contrast))
        measured.append((contrast, 100 * found.value, 100 * found.low, 100 * found.high))
    against = [m for m in measured if m[3] <= m[0].margin]
    open_ = [m for m in measured if m[2] <= m[0].margin]
    verdict = "contradicted" if against else "undecided" if open_ else "reproduced"
    shown = min(against or open_ or measured, key=lambda m: m[1] - m[0].margin)
    return verdict, _evidence(shown, len(against), len(open_), len(measured))


def _at(setting: Setting) -> dict[str, str]:
    """The values by which a setting's evaluations are selected."""
    controller = "none" if setting.method == "expert" else "tuned" if setting.tuned else "original"
    names = ("method", "task", "split", "physics", "variant")
    return {name: getattr(setting, name) for name in names} | {"controller": controller}


def _evidence(shown: Measured, against: int, open_: int, of: int) -> str:
    contrast, difference, low, high = shown
    return (
        f"{of - open_} of {count_of(of, 'comparison')} on the claimed side, {against} on the other;"
        f" {contrast.left} minus {contrast.right}: {difference:+.1f} points"
        f" [{low:.1f}, {high:.1f}], claimed above {contrast.margin:g}"
    )
