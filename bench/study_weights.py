"""The weights that a study evaluates instead of training a method: files of `methods.saved`."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from bench.labels import DIGITS
from bench.presets import Study
from bench.spec import Cell, Fit
from methods.saved import Saved, read
from tasks.errors import InputError, unknown_name


def evaluating(study: Study, given: Sequence[tuple[str, str, Path]]) -> Study:
    """Returns a study that evaluates weights of files instead of training their methods.

    Args:
        study: the study to change.
        given: method, task and file. An empty task is the only one of the study.

    Raises:
        InputError: a method or task is not in the study, a task of a method has no file or two, or
            a file cannot be read.
    """
    found: dict[tuple[str, str], Saved] = {}
    for method, named, file in given:
        place = method, named or _only_task(study, method)
        for kind, name, known in (
            ("method", method, study.methods),
            ("task", place[1], study.tasks),
        ):
            if name not in known:
                raise unknown_name(f"{kind} of the run", name, known)
        if place in found:
            raise InputError(f"--weights gives {method} on {place[1]} twice: give one file")
        found[place] = read(file)
    for method in dict.fromkeys(method for method, _ in found):
        missing = [task for task in study.tasks if (method, task) not in found]
        if missing:
            raise InputError(
                f"--weights gives no file for {method} on {', '.join(missing)}: give one for each"
                " task of the run, or choose tasks with --tasks"
            )
    notes = [_note(*place, saved) for place, saved in found.items()]
    return replace(study, weights=found, note=" ".join([study.note, *notes]).strip())


def _only_task(study: Study, method: str) -> str:
    if len(study.tasks) > 1:
        raise InputError(
            f"--weights {method}=FILE is for a run of one task, this one has"
            f" {', '.join(study.tasks)}: give {method}@TASK=FILE for each, or choose with --tasks"
        )
    return study.tasks[0]


def _note(method: str, task: str, saved: Saved) -> str:
    return (
        f"On {task}, {method} has weights from a file, {saved.file.name} ({saved.digest[:DIGITS]}),"
        " and was not trained by the suite, which does not know what it learnt from. All its seeds"
        " have these weights, so its intervals lack the luck of training."
    )


def check_weights(study: Study, experiment: str, cells: Iterable[Cell]) -> None:
    """Checks that each file of a study stands for one fit, apart from seeds, and belongs to it.

    Args:
        study: the study.
        experiment: the last experiment of the cells, for the message.
        cells: its cells and those of the experiments before it.

    Raises:
        InputError: an experiment compares several fits, or see `methods.saved.Saved.check`.
    """
    fits: dict[tuple[str, str], dict[str, Fit]] = {}
    for fit in (cell.fit for cell in cells if cell.fit.weights):
        several = fits.setdefault((fit.method, fit.task), {})
        several[replace(fit, seed=0).key] = fit
    for (method, task), several in fits.items():
        if len(several) > 1:
            raise InputError(
                f"{experiment} compares {len(several)} fits of {method} on {task}, but --weights"
                " gives one: leave out that experiment with --experiments, or the weights"
            )
        (fit,) = several.values()
        study.weights[method, task].check(fit.build(), task)
