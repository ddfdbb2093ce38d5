"""Makes a study from a preset and options, for `bench run` and `bench.run`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from bench import parsing
from tasks.errors import InputError, unknown_name
from tasks.files import path_of

if TYPE_CHECKING:
    from bench.presets import Study

Names = str | Sequence[str]
"""Names as a sequence or as a comma-separated text."""


class Options(TypedDict, total=False):
    """Options that change a preset. None keeps the preset's value."""

    experiments: Names | None
    tasks: Names | None
    methods: Names | None
    """The expert is evaluated only if ``expert`` is among them."""
    sizes: Names | None
    """Model sizes to compare."""
    variants: Names | None
    """Variants for the experiment ``variants``."""
    seeds: str | int | Sequence[int] | None
    """A count (5 means 1 to 5), a list ([2, 4]), or a text (``1-3,7``)."""
    episodes: int | None
    """Episodes of each evaluation."""
    expert: str | None
    """Which of a task's experts demonstrates: first or second."""
    demos: str | Path | Sequence[str | Path] | None
    """Files of demonstrations, one for each task of the study."""
    settings: Mapping[str, Any] | Sequence[str] | None
    """Fields of methods' configs: ``{"nn.epochs": 50}`` or ``["nn.epochs=50"]``."""
    weights: Mapping[str, str | Path] | Sequence[str] | None
    """Files of `bench.save_weights`, whose methods are not trained: ``{"nn": "nn.safetensors"}``,
    or with several tasks ``{"nn@door": "door.safetensors", ...}``."""


def study_of(study: str | Study, **options: Unpack[Options]) -> Study:
    """Returns a study with options applied.

    Args:
        study: name of a preset, or a study.
        options: see `Options`.

    Raises:
        InputError: there is no such preset or option, or a value cannot be used.
    """
    from bench.presets import Study, get_preset

    if not isinstance(study, str | Study):
        raise InputError(f"a study is the name of a preset or a Study, got {study!r}")
    chosen = get_preset(study) if isinstance(study, str) else study
    for name in options:
        if name not in _CHANGES:
            raise unknown_name("option of a study", name, _CHANGES)
    given: Mapping[str, Any] = options
    for name, change in _CHANGES.items():
        if given.get(name) is not None:
            chosen = change(chosen, given[name])
    return chosen


def _experiments(study: Study, names: Names) -> Study:
    """The experiments named, in the study's order."""
    from bench.presets import PRESETS

    text = _text(names)
    for name in parsing.names("--experiments", text):
        presets = [other for other, preset in PRESETS.items() if name in preset.episodes]
        if presets and name not in study.episodes:
            own = [f"preset {other}" for other, preset in PRESETS.items() if preset is study]
            raise InputError(
                f"the {(own or ['study'])[0]} has no experiment {name!r}: use"
                f" {' or '.join(presets)}, or choose from {', '.join(study.episodes)}"
            )
    chosen = parsing.known_names("--experiments", "experiment", text, study.episodes)
    return replace(study, episodes={name: study.episodes[name] for name in chosen})


def _episodes(study: Study, count: int) -> Study:
    try:
        number = parsing.whole_number(str(count), 1)
    except InputError as error:
        raise InputError(f"episodes {error}") from error
    return replace(study, episodes=dict.fromkeys(study.episodes, number))


def _tasks(study: Study, names: Names) -> Study:
    from bench.guest_tasks import known_task
    from tasks.registry import task_names, unusable_tasks

    known = dict.fromkeys([*task_names(), *unusable_tasks()])
    chosen = parsing.known_names("--tasks", "task", _text(names), known)
    for name in chosen:
        known_task(name)
    return replace(study, tasks=chosen)


def _methods(study: Study, names: Names) -> Study:
    from bench.spec import EXPERT
    from methods.registry import method_names, unusable

    known = dict.fromkeys([EXPERT, *method_names(), *unusable()])
    chosen = parsing.known_names("--methods", "method", _text(names), known)
    methods = tuple(name for name in chosen if name != EXPERT)
    return replace(study, methods=methods, expert=EXPERT in chosen)


def _sizes(study: Study, names: Names) -> Study:
    return replace(study, sizes=parsing.names("--sizes", _text(names)))


def _variants(study: Study, names: Names) -> Study:
    return replace(study, variants=parsing.names("--variants", _text(names)))


def _seeds(study: Study, seeds: str | int | Sequence[int]) -> Study:
    return replace(study, seeds=parsing.seeds(_text(seeds)))


def _expert(study: Study, name: str) -> Study:
    from tasks.registry import EXPERTS

    if name not in EXPERTS:
        raise unknown_name("expert", name, EXPERTS)
    return replace(study, taught_by=name)


def _demos(study: Study, files: str | Path | Sequence[str | Path]) -> Study:
    from bench.study_demos import learning_from
    from tasks.registry import FIRST

    if study.taught_by != FIRST:
        raise InputError(
            "methods learn from files of demonstrations or from the second expert, not from both:"
            " give demos or expert"
        )
    several = [files] if isinstance(files, str | Path) else files
    if not isinstance(several, Iterable):
        raise InputError(f"demos are a file or a list of files, got {files!r}")
    return learning_from(study, [path_of("a file of demos", file) for file in several])


def _settings(study: Study, settings: Mapping[str, Any] | Sequence[str]) -> Study:
    return replace(study, settings=parsing.settings(settings))


def _weights(study: Study, files: Mapping[str, str | Path] | Sequence[str]) -> Study:
    from bench.study_weights import evaluating

    return evaluating(study, parsing.weights(files))


def _text(values: str | int | Sequence[Any]) -> str:
    """Values as text of a command line. The last comma makes a single number a list of seeds."""
    if isinstance(values, str | Integral):
        return str(values)
    if not isinstance(values, Iterable):
        raise InputError(f"names are a text or a list of texts, seeds are numbers: got {values!r}")
    return "".join(f"{value}," for value in values)


_CHANGES: Mapping[str, Callable[[Study, Any], Study]] = {
    "experiments": _experiments,
    "episodes": _episodes,
    "tasks": _tasks,
    "methods": _methods,
    "sizes": _sizes,
    "variants": _variants,
    "seeds": _seeds,
    "expert": _expert,
    "demos": _demos,
    "settings": _settings,
    "weights": _weights,
}
"""By option, how it changes a study. ``demos`` and ``weights`` follow the tasks and methods that
their files must match."""
