"""What to say of rows whose protocols differ: an error, or the notes of ``--mixed``."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from bench.labels import plain
from reports.more_seeds import episodes_of, more_seeds
from reports.protocol import DEMOS_OF, KERNELS, OF_EXPERT, SEEDS
from reports.remarks import Remark
from reports.style import display, ordered
from tasks.errors import InputError
from tasks.pins import OFF, ON, SWITCH, UNPINNED
from tasks.registry import TASKS

MARK = "*"
"""Text after the name of a method that was run differently."""
SHIPPED = "shipped"


@dataclass
class Group:
    """Methods with the same settings: a column of the table in the error."""

    methods: list[str]
    shipped: bool
    values: dict[str, str]
    """Value of each setting, by name."""

    @property
    def text(self) -> str:
        """All settings in one line."""
        return ", ".join(f"{setting} {value}" for setting, value in self.values.items())


@dataclass(frozen=True)
class MixedProtocols:
    """Rows that were run under different protocols."""

    table: pd.DataFrame
    """As `reports.protocol.differences` returns it."""
    folder: Path
    """Folder of the results."""
    shipped: tuple[str, ...] = ()
    """Methods with shipped rows."""
    run_notes: tuple[str, ...] = ()
    """Notes of the results, see `bench.source.Source.notes`."""

    @property
    def tasks(self) -> list[str]:
        """The tasks on which rows differ."""
        return ordered(self.table.task, TASKS)

    @property
    def marked(self) -> frozenset[str]:
        """The methods that were run differently from the shipped ones, or else from the most.

        Of two groups of the same number of methods, the one with smaller values is marked.
        """
        found: set[str] = set()
        for task in self.tasks:
            *others, _ = sorted(self._groups(task), key=_weight)
            found.update(method for group in others for method in group.methods)
        return frozenset(found)

    @property
    def notes(self) -> list[str]:
        """What the page says of rows that are shown nevertheless, for each set of differences."""
        texts: dict[str, list[str]] = {}
        for task in self.tasks:
            groups = self._named_groups(task)
            parts = [f"{name} ({group.text})" for name, group in groups.items()]
            texts.setdefault("; ".join(parts), []).append(display(task))
        return [
            f"Rows that cannot be compared stand beside each other on {', '.join(tasks)}: {text}."
            " An asterisk marks the methods that were run differently."
            for text, tasks in texts.items()
        ]

    @property
    def remark(self) -> Remark:
        """What the caption of an exhibit with a marked method says."""
        text = "An asterisk marks the methods that were run differently: see the notes."
        return Remark(text, self.marked, frozenset(self.tasks))

    def error(self, rows: pd.DataFrame) -> InputError:
        """Returns the error that shows what differs on each task, and what to run instead."""
        return InputError(
            f"{self.text}\n"
            "to show them nevertheless, give --mixed\n"
            f"get comparable rows: {self.command(rows)}"
        )

    @property
    def text(self) -> str:
        """What differs on each task, as tables."""
        tasks_by_text: dict[tuple[str, str], list[str]] = {}
        for task in self.tasks:
            groups = self._named_groups(task)
            names = ["the shipped results" if name == SHIPPED else name for name in groups]
            text = " and ".join(names), _as_table(groups)
            tasks_by_text.setdefault(text, []).append(task)
        return "\n".join(
            f"{names} cannot be compared on {', '.join(tasks)}\n{table}"
            for (names, table), tasks in tasks_by_text.items()
        )

    def _groups(self, task: str) -> list[Group]:
        """Returns the methods of a task in groups that have no contrary settings."""
        values: dict[str, dict[str, str]] = {}
        part = self.table[self.table.task == task]
        for (method, setting), several in part.groupby(["method", "setting"], sort=False).value:
            values.setdefault(method, {})[setting] = ", ".join(several)
        groups: list[Group] = []
        for method in sorted(values, key=lambda name: -len(values[name])):
            mine, shipped = values[method], method in self.shipped
            for group in groups:
                known = group.values
                alike = all(known.get(setting, value) == value for setting, value in mine.items())
                if alike and group.shipped == shipped:
                    group.methods.append(method)
                    known |= mine
                    break
            else:
                groups.append(Group([method], shipped, dict(mine)))
        return sorted(groups, key=lambda group: group.shipped)

    def _named_groups(self, task: str) -> dict[str, Group]:
        """Returns the groups by name: their methods, or the folder beside the shipped results."""
        groups = self._groups(task)
        if [group.shipped for group in groups] == [False, True]:
            return {str(self.folder): groups[0], SHIPPED: groups[1]}
        return {
            ", ".join(group.methods) + f" ({SHIPPED})" * group.shipped: group for group in groups
        }

    def command(self, rows: pd.DataFrame) -> str:
        """Returns the command that adds seeds, if rows lack nothing else.

        Otherwise it runs the folder's methods under the shipped protocol, including shipped
        methods whose demonstrations cannot be made on this machine.
        """
        if set(self.table.setting) == {SEEDS}:
            here = rows[rows.task.isin(self.tasks)]
            if command := more_seeds(here, self.folder, self.shipped, self.run_notes):
                return command
        foreign = self.table[(self.table.setting == DEMOS_OF) & (self.table.value != OF_EXPERT)]
        methods = [
            method
            for method in self.table.method.unique()
            if method not in self.shipped or method in set(foreign.method)
        ]
        found = rows[rows.method.isin(methods) & ~rows.method.isin(self.shipped)]
        names = dict.fromkeys(map(plain, methods))
        return (
            f"{self._switch()}bench run paper --experiments {','.join(episodes_of(found))}"
            f" --tasks {','.join(self.tasks)} --methods {','.join(names)} --out {self.folder}-paper"
        )

    def _switch(self) -> str:
        """Returns what before a command gives it the kernels of the shipped results."""
        marks = self.table[self.table.setting == KERNELS]
        theirs = marks[marks.method.isin(self.shipped)].value
        if theirs.empty:
            return ""
        return f"{SWITCH}={(OFF if UNPINNED in set(theirs) else ON)[0]} "


def _weight(group: Group) -> tuple[bool, int, list[float]]:
    """Returns whether a group is shipped, its number of methods, and its values as numbers."""
    texts = [text.split(", ")[0].removesuffix("%") for text in group.values.values()]
    numbers = [float(text) if text.replace(".", "", 1).isdecimal() else 0.0 for text in texts]
    return group.shipped, len(group.methods), numbers


def _as_table(groups: Mapping[str, Group]) -> str:
    """Returns a table with a line for each setting and a column for each group."""
    settings = list(dict.fromkeys(name for group in groups.values() for name in group.values))
    lines = [["", *groups]]
    lines += [[s, *(group.values.get(s, "-") for group in groups.values())] for s in settings]
    widths = [max(map(len, texts)) for texts in zip(*lines, strict=True)]
    return "\n".join(
        "  " + "   ".join([name.ljust(widths[0]), *map(str.rjust, texts, widths[1:])])
        for name, *texts in lines
    )
