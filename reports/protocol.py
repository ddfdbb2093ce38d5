"""Which rows can be compared: those whose methods and controllers were trained alike.

Exhibits and `bench compare` show rows of several methods beside each other. On each task, these
must have learnt from the same demonstrations, with controllers that were trained alike, for the
same share of their own epochs, and with the same kernels. In each condition, methods must have the
same seeds, or several in common. The number of starts need not agree: exhibits use common ones, see
`reports.pairing`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import cache
from statistics import median
from typing import Any

import pandas as pd

from bench.controller_kinds import ORIGINAL
from bench.labels import plain
from bench.names import CONDITIONS
from reports.pairing import FEWEST, common_seeds, demos_of_expert, same_seeds, without_expert
from tasks.errors import InputError

DEMOS, DEMOS_OF, EPOCHS, SEEDS = "demos", "demos of", "share of epochs", "seeds"
KERNELS = "kernels"
"""Names of settings."""
OF_EXPERT = "the expert"
_WITHOUT_CONTROLLER = tuple(name for name in CONDITIONS if name != "controller")

Own = Mapping[tuple[str, str], str]
"""Keys of the expert's demonstrations, by task and mark of the kernels."""
Specs = Callable[[str], Mapping[str, Any]]
"""Returns the fields of a controller by key, see `bench.source.Source.controller_spec`."""
SettingValue = tuple[str, str, str, str]
"""Task, method, name of a setting, and its value."""


def differences(rows: pd.DataFrame, specs: Specs) -> pd.DataFrame:
    """Returns the settings that differ between the rows of a task.

    The expert has no settings. A setting that only some methods have, such as a controller or
    epochs, does not differ from those that lack it.

    Args:
        rows: as `bench.source.Source.frame` returns them.
        specs: of their controllers.

    Returns:
        Columns ``task``, ``method``, ``setting`` and ``value``, as text: each value that a method
        has of a setting that differs within its task. A setting is omitted if it divides the
        methods as an earlier one does. Where kernels differ, the origin of demonstrations is
        omitted, since their keys then differ anyway.
    """
    learnt, own = without_expert(rows), demos_of_expert(rows)
    found = [*_kernels(learnt), *_demonstrations(learnt, own), *_controllers(learnt, specs, own)]
    found += [*_shares(learnt), *_seeds(learnt)]
    table = pd.DataFrame(found, columns=["task", "method", "setting", "value"]).drop_duplicates()
    table = table[table.groupby(["task", "setting"]).value.transform("nunique") > 1]
    unlike = table.task.isin(table[table.setting == KERNELS].task)
    table = table[~(unlike & table.setting.str.endswith(DEMOS_OF))]
    kept: dict[str, set[tuple[str, ...]]] = {}
    for setting, part in table.groupby("setting", sort=False):
        places = set(part[["task", "method", "value"]].itertuples(index=False, name=None))
        if not any(places <= others for others in kept.values()):
            kept[str(setting)] = places
    return table[table.setting.isin(kept)].reset_index(drop=True)


def _kernels(learnt: pd.DataFrame) -> Iterator[SettingValue]:
    """Yields the marks of the kernels that computed each method, see `tasks.pins`."""
    for one in learnt.drop_duplicates(["task", "method", "pins"]).itertuples():
        yield one.task, one.method, KERNELS, one.pins


def _demonstrations(learnt: pd.DataFrame, own: Own) -> Iterator[SettingValue]:
    """Yields the origin of each method's demonstrations, and their number where it is largest.

    Args:
        learnt: rows of methods.
        own: keys of the expert's demonstrations.
    """
    in_all = learnt.assign(in_all=learnt.demos + learnt.held_out)
    most = in_all.groupby(["task", "method", "variant", *CONDITIONS], sort=False).in_all.max()
    for (task, method, *_), count in most.items():
        yield task, method, DEMOS, str(count)
    for one in learnt.drop_duplicates(["task", "method", "demos_key"]).itertuples():
        yield one.task, one.method, DEMOS_OF, _origin(one.demos_key, own.get((one.task, one.pins)))


def _origin(demos_key: str, own: str | None) -> str:
    return OF_EXPERT if demos_key == own else demos_key[:8]


def _controllers(learnt: pd.DataFrame, specs: Specs, own: Own) -> Iterator[SettingValue]:
    """Yields the training settings of controllers, by name. Lost controllers are skipped."""
    specs = cache(specs)
    used = learnt[learnt.controller_key != ""]
    for one in used.drop_duplicates(["task", "method", "controller_key"]).itertuples():
        name = "controller" if one.controller == ORIGINAL else f"{one.controller} controller"
        try:
            spec = specs(one.controller_key)
        except InputError:
            continue
        origin = _origin(spec["demos_key"], own.get((one.task, one.pins)))
        fields = {**spec["config"], DEMOS: spec["demos"], DEMOS_OF: origin}
        for field, value in fields.items():
            yield one.task, one.method, f"{name} {field.replace('_', ' ')}", str(value)


def _shares(learnt: pd.DataFrame) -> Iterator[SettingValue]:
    """Yields the share of its own epochs that each method was trained for."""
    named = zip(learnt.task, learnt.method, learnt.variant, learnt["size"], strict=True)
    found = dict.fromkeys(
        (*names, config["epochs"])
        for names, config in zip(named, learnt.config, strict=True)
        if _is_count(config.get("epochs"))
    )
    trained: dict[str, list[tuple[str, int, int]]] = {}
    for task, method, variant, size, count in found:
        if own := own_epochs(plain(method), variant, size):
            trained.setdefault(task, []).append((method, count, own))
    for task, epochs in trained.items():
        for method, share in _rounded_alike(epochs):
            yield task, method, EPOCHS, share


def _seeds(learnt: pd.DataFrame) -> Iterator[SettingValue]:
    """Yields the seeds of methods in conditions where they differ and too few are common."""
    for (task, *_), part in learnt.groupby(["task", *_WITHOUT_CONTROLLER], sort=False):
        groups = {method: set(seeds) for method, seeds in part.groupby("method").seed}
        if len(common_seeds(groups.values())) < FEWEST and not same_seeds(part):
            for method, seeds in groups.items():
                yield str(task), str(method), SEEDS, " ".join(map(str, sorted(seeds)))


def own_epochs(method: str, variant: str, size: str) -> int | None:
    """Returns the epochs in a method's own config. None if it has none or is not installed."""
    from bench.checking import known
    from methods.registry import SUITE, get_method

    try:
        found = get_method(method, variant) if method in SUITE else known(method)
    except InputError:
        return None
    if size not in found.sizes or variant not in found.variants:
        return None
    epochs = {**asdict(found.sizes[size]), **found.variants[variant]}.get("epochs")
    return epochs if _is_count(epochs) else None


def _is_count(value: object) -> bool:
    return isinstance(value, int) and value > 0


def _rounded_alike(trained: Sequence[tuple[str, int, int]]) -> Iterator[tuple[str, str]]:
    """Yields methods with their share of epochs: one share where only whole epochs tell them apart.

    Args:
        trained: name of each method, the epochs that it was trained for, and its own epochs.
    """
    groups: list[tuple[float, float, list[tuple[str, int, int]]]] = []
    # The most precise come first, so that a rough share joins the group that it may belong to.
    for method, epochs, own in sorted(trained, key=lambda one: -one[2]):
        # Any small share is rounded up to one epoch.
        low, high = (epochs - 0.5) / own if epochs > 1 else 0.0, (epochs + 0.5) / own
        for place, (least, most, members) in enumerate(groups):
            if max(low, least) <= min(high, most):
                members.append((method, epochs, own))
                groups[place] = max(low, least), min(high, most), members
                break
        else:
            groups.append((low, high, [(method, epochs, own)]))
    for least, most, members in groups:
        share = median(epochs / own for _, epochs, own in members)
        text = f"{round(100 * min(max(share, least), most), 1):g}%"
        yield from ((method, text) for method, _, _ in members)
