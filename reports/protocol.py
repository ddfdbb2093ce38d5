"""Whether rows can be compared: what methods and controllers learnt from, and for how long.

An exhibit, or `bench compare`, lays rows of several methods beside each other. They can be compared
if on each task the methods learnt from the same demonstrations, the controllers of one name were
trained alike, all methods trained for the same share of their own epochs, and those with seeds have
the same or several in common. Starts are not compared: exhibits use those in common, see
`reports.alike`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from statistics import median
from typing import Any

import pandas as pd

from bench.controller_kinds import ORIGINAL
from bench.labels import EXPERT, plain
from bench.names import CONDITIONS
from reports.alike import FEWEST, common_seeds
from reports.remarks import Remark
from reports.style import TASKS, display, ordered
from tasks.errors import InputError
from tasks.masses import NOMINAL

DEMOS, RECIPE, EPOCHS, SEEDS = "demos", "demos of", "share of epochs", "seeds"
OF_EXPERT = "the expert"
MARK = "*"
"""Follows the name of a method that was run otherwise than most."""
SHIPPED = "shipped"

Specs = Callable[[str], Mapping[str, Any]]
"""Returns the fields of the controller with a key, see `bench.source.Source.controller_spec`."""
Setting = tuple[str, str, str, str]
"""Task, method, name of a setting, and its value."""


def differences(rows: pd.DataFrame, specs: Specs) -> pd.DataFrame:
    """Returns the settings that have several values among the rows of a task.

    The expert learns from nothing and has no settings. Settings that one has and another lacks, as
    a controller or epochs, do not differ.

    Args:
        rows: as `bench.source.Source.frame` gives them.
        specs: of their controllers.

    Returns:
        Columns ``task``, ``method``, ``setting`` and ``value``, as text: each value that a method
        has of a setting that differs within its task. A setting is left out if it differs only as
        one before it does.
    """
    learnt = rows[rows.method != EXPERT]
    experts = rows[rows.method == EXPERT].drop_duplicates("task")
    own = dict(zip(experts.task, experts.demos_key, strict=True))
    found = [*_demonstrations(learnt, own), *_controllers(learnt, specs, own)]
    found += [*_shares(learnt), *_seeds(learnt)]
    table = pd.DataFrame(found, columns=["task", "method", "setting", "value"]).drop_duplicates()
    table = table[table.groupby(["task", "setting"]).value.transform("nunique") > 1]
    kept: dict[str, set[tuple[str, ...]]] = {}
    for setting, part in table.groupby("setting", sort=False):
        places = set(part[["task", "method", "value"]].itertuples(index=False, name=None))
        if not any(places <= others for others in kept.values()):
            kept[str(setting)] = places
    return table[table.setting.isin(kept)].reset_index(drop=True)


def _demonstrations(learnt: pd.DataFrame, own: Mapping[str, str]) -> Iterator[Setting]:
    """Whose demonstrations methods learnt from, and how many where they learnt from the most.

    The expert's demonstrations have the keys in own, by task.
    """
    most = learnt.groupby(["task", "method", "variant", *CONDITIONS], sort=False).demos.max()
    for (task, method, *_), count in most.items():
        yield task, method, DEMOS, str(count)
    for one in learnt.drop_duplicates(["task", "method", "demos_key"]).itertuples():
        yield one.task, one.method, RECIPE, _origin(one.demos_key, own.get(one.task))


def _origin(recipe: str, own: str | None) -> str:
    return OF_EXPERT if recipe == own else recipe[:8]


def _controllers(learnt: pd.DataFrame, specs: Specs, own: Mapping[str, str]) -> Iterator[Setting]:
    """What the controllers of one name were trained with; nothing of a controller that is lost."""
    specs = cache(specs)
    used = learnt[learnt.controller_key != ""]
    for one in used.drop_duplicates(["task", "method", "controller_key"]).itertuples():
        name = "controller" if one.controller == ORIGINAL else f"{one.controller} controller"
        try:
            spec = specs(one.controller_key)
        except InputError:
            continue
        origin = _origin(spec["demos_key"], own.get(one.task))
        fields = {**spec["config"], DEMOS: spec["demos"], RECIPE: origin}
        for field, value in fields.items():
            yield one.task, one.method, f"{name} {field.replace('_', ' ')}", str(value)


def _shares(learnt: pd.DataFrame) -> Iterator[Setting]:
    """The share of its own epochs that each method has trained for."""
    named = zip(learnt.task, learnt.method, learnt.variant, learnt["size"], strict=True)
    found = dict.fromkeys(
        (*names, config["epochs"])
        for names, config in zip(named, learnt.config, strict=True)
        if _is_count(config.get("epochs"))
    )
    trained: dict[str, list[tuple[str, int, int]]] = {}
    for task, method, variant, size, epochs in found:
        if own := own_epochs(plain(method), variant, size):
            trained.setdefault(task, []).append((method, epochs, own))
    for task, claims in trained.items():
        for method, share in _rounded_alike(claims):
            yield task, method, EPOCHS, share


def _seeds(learnt: pd.DataFrame) -> Iterator[Setting]:
    """The seeds of the methods of tasks where they have too few in common."""
    for task, part in learnt[learnt.seed > 0].groupby("task", sort=False):
        groups = {method: set(seeds) for method, seeds in part.groupby("method").seed}
        if len(common_seeds(groups.values())) < FEWEST:
            for method, seeds in groups.items():
                yield str(task), str(method), SEEDS, " ".join(map(str, sorted(seeds)))


def own_epochs(method: str, variant: str, size: str) -> int | None:
    """Returns the epochs of a method's own config; None if it is not installed or has none."""
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


def _rounded_alike(claims: Sequence[tuple[str, int, int]]) -> Iterator[tuple[str, str]]:
    """Methods and their shares of epochs, one share where rounding to whole epochs explains both.

    Args:
        claims: of each the method, the epochs that it has trained for, and its own epochs.
    """
    groups: list[tuple[float, float, list[tuple[str, int, int]]]] = []
    # The most precise first, so that what is known roughly joins what it may be.
    for method, epochs, own in sorted(claims, key=lambda claim: -claim[2]):
        # One epoch is the least there is, whatever the share.
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


@dataclass
class Column:
    """Methods that were run alike, and their settings."""

    methods: list[str]
    shipped: bool
    cells: dict[str, str]
    """By setting, its value."""


@dataclass(frozen=True)
class Unlike:
    """Rows that differ in their protocol."""

    table: pd.DataFrame
    """What `differences` returns."""
    folder: Path
    """Of the results."""
    shipped: tuple[str, ...] = ()
    """Methods whose rows are the shipped ones."""

    @property
    def tasks(self) -> list[str]:
        """The tasks on which rows differ."""
        return ordered(self.table.task, TASKS)

    @property
    def marked(self) -> frozenset[str]:
        """The methods that were run otherwise than the shipped ones, or else than most.

        Of as many, those of smaller settings.
        """
        found: set[str] = set()
        for task in self.tasks:
            *others, _ = sorted(self._columns(task), key=_weight)
            found.update(method for column in others for method in column.methods)
        return frozenset(found)

    @property
    def notes(self) -> list[str]:
        """What a page says of rows that are shown all the same."""
        texts: dict[str, list[str]] = {}
        for task in self.tasks:
            columns = self._headed(task)
            parts = [f"{name} ({_listed(column.cells)})" for name, column in columns.items()]
            texts.setdefault("; ".join(parts), []).append(display(task))
        return [
            f"Rows that cannot be compared stand beside each other on {', '.join(tasks)}: {text}."
            " An asterisk marks the methods that were run differently."
            for text, tasks in texts.items()
        ]

    @property
    def remark(self) -> Remark:
        """What the captions of exhibits with a marked method say."""
        text = "An asterisk marks the methods that were run differently: see the notes."
        return Remark(text, self.marked, frozenset(self.tasks))

    def refusal(self, rows: pd.DataFrame) -> InputError:
        """Returns the error that shows what differs on each task, and what to run instead."""
        drawings: dict[tuple[str, str], list[str]] = {}
        for task in self.tasks:
            columns = self._headed(task)
            names = ["the shipped results" if name == SHIPPED else name for name in columns]
            drawings.setdefault((" and ".join(names), _drawn(columns)), []).append(task)
        shown = "\n".join(
            f"{what} cannot be compared on {', '.join(tasks)}\n{drawing}"
            for (what, drawing), tasks in drawings.items()
        )
        return InputError(
            f"{shown}\n"
            "to see them all the same, give --mixed\n"
            f"get comparable rows: {self._command(rows)}"
        )

    def _columns(self, task: str) -> list[Column]:
        """The methods of a task in groups that do not contradict each other."""
        cells: dict[str, dict[str, str]] = {}
        part = self.table[self.table.task == task]
        for (method, setting), values in part.groupby(["method", "setting"], sort=False).value:
            cells.setdefault(method, {})[setting] = ", ".join(values)
        columns: list[Column] = []
        for method in sorted(cells, key=lambda name: -len(cells[name])):
            mine, shipped = cells[method], method in self.shipped
            for column in columns:
                known = column.cells
                alike = all(known.get(setting, value) == value for setting, value in mine.items())
                if alike and column.shipped == shipped:
                    column.methods.append(method)
                    known |= mine
                    break
            else:
                columns.append(Column([method], shipped, dict(mine)))
        return sorted(columns, key=lambda column: column.shipped)

    def _headed(self, task: str) -> dict[str, Column]:
        """The columns by heading: where both are one column, the folder and the shipped results."""
        columns = self._columns(task)
        if [column.shipped for column in columns] == [False, True]:
            return {str(self.folder): columns[0], SHIPPED: columns[1]}
        return {
            ", ".join(column.methods) + f" ({SHIPPED})" * column.shipped: column
            for column in columns
        }

    def _command(self, rows: pd.DataFrame) -> str:
        """The command that runs alike what is of the folder, and shipped methods if need be."""
        elsewhere = self.table[(self.table.setting == RECIPE) & (self.table.value != OF_EXPERT)]
        methods = [
            method
            for method in self.table.method.unique()
            if method not in self.shipped or method in set(elsewhere.method)
        ]
        found = rows[rows.method.isin(methods) & ~rows.method.isin(self.shipped)]
        experiments = {
            "sizes": found.split == "validation",
            "success": (found.split == "test") & (found.physics == NOMINAL),
            "ood": found.split == "ood",
            "robustness": found.physics != NOMINAL,
        }
        chosen = [name for name, asked in experiments.items() if asked.any()]
        names = dict.fromkeys(map(plain, methods))
        return (
            f"bench run paper --experiments {','.join(chosen)} --tasks {','.join(self.tasks)}"
            f" --methods {','.join(names)} --out {self.folder}-paper"
        )


def _weight(column: Column) -> tuple[bool, int, list[float]]:
    """Whether a column is shipped, how many methods it has, and its settings as numbers."""
    texts = [text.split(", ")[0].removesuffix("%") for text in column.cells.values()]
    numbers = [float(text) if text.replace(".", "", 1).isdecimal() else 0.0 for text in texts]
    return column.shipped, len(column.methods), numbers


def _listed(cells: Mapping[str, str]) -> str:
    return ", ".join(f"{setting} {value}" for setting, value in cells.items())


def _drawn(columns: Mapping[str, Column]) -> str:
    """A table with a line for each setting."""
    settings = list(dict.fromkeys(name for column in columns.values() for name in column.cells))
    lines = [["", *columns]]
    lines += [[s, *(column.cells.get(s, "-") for column in columns.values())] for s in settings]
    widths = [max(map(len, texts)) for texts in zip(*lines, strict=True)]
    return "\n".join(
        "  " + "   ".join([name.ljust(widths[0]), *map(str.rjust, texts, widths[1:])])
        for name, *texts in lines
    )
