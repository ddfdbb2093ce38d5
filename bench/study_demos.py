"""The demonstrations that a study learns from: the expert's, or those of files."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from bench.presets import Study
from tasks.demos import adopt_demos, demos_key, load_adopted, split
from tasks.demos_files import task_of
from tasks.errors import InputError
from tasks.registry import get_task

DemosKeys = Mapping[str, str]
"""By task, the key of the demonstrations."""


def demos_keys_of(study: Study) -> DemosKeys:
    """Returns by task the key of the demonstrations that a study learns from."""
    return {task: demos_key_of(study, task) for task in study.tasks}


def demos_key_of(study: Study, task: str) -> str:
    """Returns the key of the demonstrations of a task that a study learns from."""
    return study.demos_keys.get(task) or demos_key(get_task(task), study.taught_by)


def learning_from(study: Study, files: Sequence[Path]) -> Study:
    """Returns a study that learns from files of demonstrations instead of the expert's.

    Args:
        study: the study to change.
        files: one for each task of the study.

    Raises:
        InputError: a task has no file, or two; a file shows a task that is not in the study; or a
            file cannot be used, see `adopt_demos`.
    """
    chosen = _by_task(study, files)
    keys = {task: adopt_demos(get_task(task), file) for task, file in chosen.items()}
    counts = [len(split(load_adopted(get_task(task), keys[task]))[0]) for task in keys]
    notes = [
        f"On {task}, the methods and the original controller learnt from the demonstrations of"
        f" {file.name}. The expert in the tables is the suite's own, not the demonstrator of that"
        " file; tuned and unclipped controllers learnt from the suite's expert. Each seed trains on"
        " four fifths of the file that it draws."
        for task, file in chosen.items()
    ]
    return replace(
        study,
        demos_keys=keys,
        demos=min(study.demos, *counts),
        note=" ".join([study.note, *notes]).strip(),
    )


def _by_task(study: Study, files: Sequence[Path]) -> dict[str, Path]:
    """The files by task, in the study's order."""
    found: dict[str, Path] = {}
    for file in files:
        name = _task_of(study, file)
        if name in found:
            raise InputError(f"--demos {found[name]} and {file} both show {name}: give one of them")
        found[name] = file
    missing = [task for task in study.tasks if task not in found]
    if missing:
        raise InputError(
            f"--demos gives demonstrations of {', '.join(found) or 'no task'}, not of"
            f" {', '.join(missing)}: give a file for each task of the run, or choose tasks with"
            " --tasks"
        )
    return {task: found[task] for task in study.tasks}


def _task_of(study: Study, file: Path) -> str:
    """The task that a file shows. If the file does not say, it is the only task of the study."""
    name = task_of(file)
    if not name and len(study.tasks) > 1:
        raise InputError(
            f"--demos {file} does not say which task it shows: choose that task with --tasks"
        )
    name = name or study.tasks[0]
    if name not in study.tasks:
        raise InputError(
            f"--demos {file} holds demonstrations of {name}, which is not among the tasks of"
            f" the run ({', '.join(study.tasks)}): change --tasks"
        )
    return name
