"""The sizes that a study compares, and the chosen size, which all other experiments use."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from bench.labels import VALIDATION
from bench.presets import SMALLEST, Study
from methods.base import Method
from methods.registry import get_method
from tasks.errors import unknown_name
from tasks.registry import get_task

if TYPE_CHECKING:
    import pandas as pd

Sizes = Mapping[tuple[str, str], str]
"""By task and method, the size that does best on validation starts."""


SIZES = ("small", "median", "large")
"""The sizes of Tables 2-5, in their order."""


def ordered_sizes(sizes: Iterable[str]) -> list[str]:
    """Returns sizes, each once: those of Tables 2-5 in their order, then others as they came."""
    found = dict.fromkeys(sizes)
    return sorted(found, key=lambda size: SIZES.index(size) if size in SIZES else len(SIZES))


def best_size(evaluations: "pd.DataFrame", sizes: Sequence[str]) -> str:
    """Returns the size with the highest mean success over seeds (Tables 2-5).

    Of sizes with the same mean, the first is chosen. A size without evaluations comes last.

    Args:
        evaluations: evaluations of one task and method from validation starts, with the columns
            ``size``, ``successes`` and ``episodes``.
        sizes: the sizes to choose from.
    """
    rates = evaluations.successes / evaluations.episodes
    # Rounded, since the order of the rates changes the last digit of their mean.
    means = rates.groupby(evaluations["size"]).mean().round(9)
    return max(sizes, key=lambda size: float(means.get(size, -1.0)))


def best_validated(validated: "pd.DataFrame", sizes: Iterable[str]) -> str:
    """Returns the `best_size` by the fits with the most demonstrations, as in a run.

    Args:
        validated: see `best_size`, with the column ``demos``.
        sizes: the sizes to choose from. Of equal ones, the first by `ordered_sizes` is chosen.
    """
    most = validated[validated.demos == validated.demos.max()]
    return best_size(most, ordered_sizes(sizes))


def chosen_sizes(study: Study, frame: "pd.DataFrame") -> dict[tuple[str, str], str]:
    """Returns by task and method the size that does best on validation starts, see `best_size`.

    Args:
        study: its tasks and methods are considered.
        frame: stored evaluations, with the columns `bench.source.COLUMNS`.
    """
    if frame.empty:
        return {}
    compared = frame[
        (frame.split == VALIDATION)
        & (frame.variant == "described")
        & (frame.demos == study.demos)
        & (frame.expert == study.taught_by)
        & frame.seed.isin(study.seeds)
    ]
    chosen = {}
    for (task, name), part in compared.groupby(["task", "method"]):
        if task in study.tasks and name in study.methods:
            sizes = compared_sizes(study, get_method(name))
            if part["size"].isin(sizes).any():
                chosen[task, name] = best_size(part, sizes)
    return chosen


def compared_sizes(study: Study, method: type[Method]) -> list[str]:
    """Returns the sizes of a method that the study compares.

    These are all sizes of the method if it has none of those that the study names.
    """
    known = list(method.sizes)
    named = [known[0] if size == SMALLEST else size for size in study.sizes or ()]
    return [size for size in known if size in named] or known


def used_size(study: Study, method: type[Method], task: str, chosen: Sizes) -> str:
    """Returns the size of a method in every experiment but ``sizes``.

    Raises:
        InputError: the task names a size that the method has not.
    """
    if (task, method.name) in chosen:
        return chosen[task, method.name]
    compared = compared_sizes(study, method)
    own = method.default_size.get(task) or get_task(task).default_sizes.get(method.name)
    if own and own not in method.sizes:
        raise unknown_name(f"size of {method.name} in default_sizes of {task}", own, method.sizes)
    default = own or compared[0]
    return default if default in compared else compared[0]
