"""Describes tasks, methods, experiments and presets as dictionaries, for `bench describe`."""

from dataclasses import asdict
from typing import Any

from tasks.base import SPLITS, Task
from tasks.components import Range
from tasks.errors import InputError, nearest_name, reason_of
from tasks.experts import experts_of, load_expert
from tasks.masses import NOMINAL
from tasks.registry import TASKS, get_task, task_names, unknown_task, unusable_tasks

SEED = (
    "A seed repeats the whole study: it draws the demonstrations, the test starts, and the random"
    " numbers of controllers and methods. All methods of a seed share what it draws; two seeds"
    " share only the expert and the sizes that `sizes` chooses."
)


def describe(name: str) -> dict[str, Any]:
    """Describes a task, method, experiment or preset; ``kind`` says which of them it is.

    Raises:
        InputError: nothing has that name.
    """
    from bench.presets import PRESETS, experiment_names
    from methods.registry import method_names, unknown_method, unusable

    kinds = (
        ("task", task_names(), _task),
        ("method", method_names(), _method),
        ("experiment", experiment_names(), _experiment),
        ("preset", PRESETS, _preset),
    )
    for kind, names, particulars in kinds:
        if name in names:
            return {"kind": kind, **particulars(name)}
    if name in unusable():
        raise unknown_method(name)
    if name in unusable_tasks():
        raise unknown_task(name)
    nearest = nearest_name(name, [known for _, names, _ in kinds for known in names])
    hint = f"; did you mean {nearest!r}?" if nearest else ""
    known = "".join(f"\n  {kind}s: {', '.join(names)}" for kind, names, _ in kinds)
    raise InputError(f"unknown name {name!r}{hint}\nthere are{known}")


def _task(name: str) -> dict[str, Any]:
    from bench.guest_tasks import known_task

    task = known_task(name)
    return {
        "name": task.name,
        "summary": task.summary,
        "version": task.version,
        "robot_dim": task.layout.robot_dim,
        "object_dim": task.layout.object_dim,
        "action_dim": task.layout.action_dim,
        "horizon": task.horizon,
        "components": [asdict(component) for component in task.components],
        "starts": [asdict(component) for component in task.start_components],
        "splits": {split: [_limits(task, box) for box in task.ranges(split)] for split in SPLITS},
        "reading": asdict(task.reading),
        "success": task.rule,
        "physics": {NOMINAL: None} | {name: asdict(c) for name, c in task.changes.items()},
        "experts": [_expert(task, name) for name in experts_of(task)],
        "model_file": task.model_file,
        "model_hash": task.model_hash,
    }


def _expert(task: Task, name: str) -> dict[str, Any]:
    """What the card of an expert says, see `bench.probe`; None for what it does not say."""
    card = load_expert(task, name).card
    shares = {s: n["successes"] / card["episodes"] for s, n in card.get("success", {}).items()}
    judged = card.get("imitation", {})
    return {
        "name": name,
        "seed": card.get("seed"),
        "steps": card.get("steps"),
        **{split: shares.get(split) for split in ("probe", "ood")},
        **{probe: judged.get(probe) for probe in ("tracked", "kodex")},
        "faults": card.get("faults"),
    }


def _method(name: str) -> dict[str, Any]:
    from bench.checking import known
    from methods.base import MotionMethod

    method = known(name)
    return {
        "name": name,
        "summary": getattr(method, "summary", ""),
        "version": method.version,
        "predicts": "motions" if issubclass(method, MotionMethod) else "actions",
        "validates": method.validates,
        "sizes": {size: asdict(config) for size, config in method.sizes.items()},
        "default_size": dict(method.default_size),
        "variants": {variant: dict(changes) for variant, changes in method.variants.items()},
        "parameters": {size: _parameters(name, size) for size in method.sizes},
    }


def _parameters(name: str, size: str) -> dict[str, Any]:
    """By task, the number of values that a fit stores; ``unknown`` with a reason if it fails."""
    from bench.isolation import apart
    from methods.registry import SUITE

    try:
        if name in SUITE:
            return {task: _count(name, size, task) for task in TASKS}
        return {task: apart(_count, name, size, task) for task in TASKS}
    except Exception as error:
        return dict.fromkeys(TASKS, "unknown") | {"reason": reason_of(error)}


def _count(name: str, size: str, task: str) -> int:
    """The number of values that a fit stores, counted after a short fit."""
    from bench.machine import random_demos
    from methods.base import shortened
    from methods.registry import get_method

    method = get_method(name)
    training, validation = random_demos(task)
    fitted = method(shortened(method.sizes[size], 1), get_task(task).layout)
    fitted.fit(training, validation, 1)
    return sum(array.size for array in fitted.parameters().values())


def _experiment(name: str) -> dict[str, Any]:
    from bench.describe_experiment import describe_experiment

    return describe_experiment(name)


def _preset(name: str) -> dict[str, Any]:
    from bench.experiments import cells_of
    from bench.presets import get_preset
    from bench.study_demos import demos_keys_of

    study = get_preset(name)
    cells = cells_of(study, demos_keys_of(study))
    return {
        "name": name,
        "note": study.note,
        "tasks": list(study.tasks),
        "methods": list(study.methods),
        "sizes": "all" if study.sizes is None else list(study.sizes),
        "seeds": list(study.seeds),
        "seed": SEED,
        "demos": study.demos,
        "epochs_share": study.epochs_share,
        "episodes": dict(study.episodes),
        "fits": len({cell.fit.key for cell in cells}),
        "evaluations": len(cells),
        "episodes_in_all": sum(cell.episodes for cell in cells),
    }


def _limits(task: Task, box: Range) -> dict[str, list[float]]:
    names = [component.name for component in task.start_components]
    limits = zip(names, box.low, box.high, strict=True)
    return {name: [low, high] for name, low, high in limits}
