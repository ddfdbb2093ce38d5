"""The experiments, each as a list of cells. Experiments may share cells."""

from collections.abc import Callable, Iterable
from dataclasses import replace

from bench.cells import Conditions, cells, tracked
from bench.controller_kinds import FINE_TUNED, ON_SUCCESSES, TUNED, UNCLIPPED
from bench.fits import (
    chosen_fits,
    fits_of_kodex,
    fits_of_sizes,
    fits_of_variants,
    held_out,
    in_its_own_words,
)
from bench.presets import Study
from bench.selection import Sizes
from bench.settings import check_names, check_settings
from bench.spec import EXPERT, VALIDATION, Cell
from bench.study_demos import DemosKeys
from bench.study_weights import check_weights
from methods.kodex import LIFTING_VARIANTS
from methods.registry import get_method
from tasks.disturbances import REPLANNED, names_of
from tasks.errors import InputError, unknown_name
from tasks.masses import NOMINAL, READINGS
from tasks.registry import APPENDIX, JUDGED_OTHERWISE, PUBLISHED, get_task

CHANGE_PHYSICS = ("robustness", "closed_loop", "readings", "controllers")
"""Experiments that a task without variations of the physics cannot have."""
EFFICIENCY_DEMOS = (10, 25, 50, 100, 150, 200)
REPLANS = (20, 5, 1)
"""Control steps between two predictions."""
UNSEEN, OOD, ON_VALIDATION = Conditions("test"), Conditions("ood"), Conditions(VALIDATION)


def sizes(study: Study, chosen: Sizes) -> list[Cell]:
    """Success of each size from the starts of the validation demonstrations (Tables 1-5)."""
    return cells(study, fits_of_sizes(study), [ON_VALIDATION], study.episodes["sizes"])


def success(study: Study, chosen: Sizes) -> list[Cell]:
    """Success of methods and experts from unseen starts."""
    return cells(study, chosen_fits(study, chosen), [UNSEEN], study.episodes["success"])


def ood(study: Study, chosen: Sizes) -> list[Cell]:
    """Success of methods and experts from starts out of distribution (Fig. 5)."""
    return cells(study, chosen_fits(study, chosen), [OOD], study.episodes["ood"])


def robustness(study: Study, chosen: Sizes) -> list[Cell]:
    """Success in changed physics, with the original and the expert-tuned controller (I)."""
    fits, episodes = chosen_fits(study, chosen), study.episodes["robustness"]
    variations = _variations(study, "robustness")
    original = [Conditions("test", physics) for physics in (NOMINAL, *variations)]
    tuned = [Conditions("test", physics, TUNED) for physics in variations]
    return [
        *cells(study, fits, original, episodes),
        *cells(study, tracked(fits), tuned, episodes),
    ]


def lifting(study: Study, chosen: Sizes) -> list[Cell]:
    """Success of KODex with each set of observables (Table 11, Fig. 6)."""
    fits = fits_of_kodex(study, LIFTING_VARIANTS)
    return cells(study, fits, [UNSEEN], study.episodes["lifting"])


def stability(study: Study, chosen: Sizes) -> list[Cell]:
    """KODex fitted to all demonstrations, for its eigenvalues (Table 12, Fig. 7)."""
    return cells(study, fits_of_kodex(study), [ON_VALIDATION], study.episodes["stability"])


def efficiency(study: Study, chosen: Sizes) -> list[Cell]:
    """Success against the number of demonstrations, those held out for validation included."""
    fits = [
        held_out(fit)
        for count in EFFICIENCY_DEMOS
        if count <= study.demos
        for fit in chosen_fits(replace(study, demos=count, expert=False), chosen)
    ]
    return cells(study, fits, [UNSEEN], study.episodes["efficiency"])


def disturbed(study: Study, chosen: Sizes) -> list[Cell]:
    """Success when hand, object, sensors or actions are not as they should be."""
    found = []
    for task in study.tasks:
        conditions = [Conditions("test", disturbance=name) for name in names_of(get_task(task))]
        fits = chosen_fits(replace(study, tasks=(task,)), chosen)
        found += cells(study, fits, [UNSEEN, *conditions], study.episodes["disturbed"])
    return found


def closed_loop(study: Study, chosen: Sizes) -> list[Cell]:
    """Success of methods that predict a motion anew on the way, never to at every step."""
    fits = [fit for fit in tracked(chosen_fits(study, chosen)) if get_method(fit.method).replans]
    variations = _variations(study, "closed_loop")
    conditions = [
        replace(place, replan=replan)
        for replan in (0, *REPLANS)
        for place in (
            *(Conditions("test", physics) for physics in (NOMINAL, *variations)),
            *(Conditions("test", disturbance=name) for name in REPLANNED),
        )
    ]
    return cells(study, fits, conditions, study.episodes["closed_loop"])


def variants(study: Study, chosen: Sizes) -> list[Cell]:
    """Success of methods trained as described, as published, and in their other variants."""
    fits = fits_of_variants(study, chosen)
    return cells(study, fits, [UNSEEN], study.episodes["variants"])


def rules(study: Study, chosen: Sizes) -> list[Cell]:
    """Success by the rules of the appendix and of the published code, where these differ."""
    tasks = tuple(task for task in study.tasks if task in JUDGED_OTHERWISE)
    fits = chosen_fits(replace(study, tasks=tasks), chosen)
    judged = [Conditions("test", rule=rule) for rule in (APPENDIX, PUBLISHED)]
    return cells(study, fits, judged, study.episodes["rules"])


def readings(study: Study, chosen: Sizes) -> list[Cell]:
    """Success with other readings of the masses in appendix I, which differ from task to task."""
    found = []
    for task in study.tasks:
        changed = [Conditions("test", physics) for physics in READINGS.get(task, ())]
        fits = chosen_fits(replace(study, tasks=(task,)), chosen)
        found += cells(study, fits, changed, study.episodes["readings"])
    return found


def controllers(study: Study, chosen: Sizes) -> list[Cell]:
    """Success with controllers that learnt from something else, or started elsewhere."""
    tried = [
        Conditions("test", controller=UNCLIPPED),
        *(
            Conditions("test", physics, kind)
            for kind in (ON_SUCCESSES, FINE_TUNED)
            for physics in _variations(study, "controllers")
        ),
    ]
    return cells(study, tracked(chosen_fits(study, chosen)), tried, study.episodes["controllers"])


def _variations(study: Study, experiment: str) -> tuple[str, ...]:
    """The variations of the physics of all tasks of a study, each once.

    Raises InputError for an experiment on a task that has none.
    """
    by_task = {task: get_task(task).variations for task in study.tasks}
    for task, variations in by_task.items():
        if not variations:
            others = [name for name in study.episodes if name not in CHANGE_PHYSICS]
            cure = (
                f"--experiments {','.join(others)} leaves it out"
                if others
                else "choose other experiments with --experiments"
            )
            raise InputError(
                f"the experiment {experiment} changes the physics, and task {task!r} defines no"
                f" `changes`: {cure}"
            )
    return tuple(dict.fromkeys(name for names in by_task.values() for name in names))


EXPERIMENTS: dict[str, Callable[[Study, Sizes], list[Cell]]] = {
    "sizes": sizes,
    "success": success,
    "ood": ood,
    "robustness": robustness,
    "lifting": lifting,
    "stability": stability,
    "efficiency": efficiency,
    "disturbed": disturbed,
    "closed_loop": closed_loop,
    "variants": variants,
    "rules": rules,
    "readings": readings,
    "controllers": controllers,
}


def first_wave(study: Study, demos_keys: DemosKeys) -> list[Cell]:
    """Returns the cells that decide the sizes of the others; none if no sizes are compared.

    Args:
        study: the study.
        demos_keys: see `bench.study_demos.demos_keys_of`.
    """
    return sizes(replace(study, demos_keys=demos_keys), {}) if "sizes" in study.episodes else []


def cells_of(study: Study, demos_keys: DemosKeys, chosen: Sizes | None = None) -> list[Cell]:
    """Returns the cells of all experiments of a study, each once.

    Args:
        study: the study.
        demos_keys: see `bench.study_demos.demos_keys_of`.
        chosen: by task and method, the size in all experiments but ``sizes``. Default: the
            methods' default sizes.

    Raises:
        InputError: the study names an experiment, size, variant or field that does not exist, a
            value that a method refuses, or variants without the experiment that compares them; or
            a file of weights is not of the fit that it takes the place of.
    """
    for name in study.episodes:
        if name not in EXPERIMENTS:
            raise unknown_name("experiment", name, EXPERIMENTS)
    check_names(study)
    check_settings(study)
    found: list[Cell] = []
    for name in study.episodes:
        found += EXPERIMENTS[name](replace(study, demos_keys=demos_keys), chosen or {})
        check_weights(study, name, found)
    found = _once(found)
    if not found and study.episodes:
        raise InputError(
            f"{', '.join(study.episodes)}: nothing to evaluate with"
            f" {', '.join(study.methods) or 'no method'} and {study.demos} demonstrations; `bench"
            " describe` tells which methods an experiment is for"
        )
    _check_configs(found)
    return found


def _once(given: Iterable[Cell]) -> list[Cell]:
    """The cells without repetition; of the same evaluation, the cell with the most episodes."""
    found: dict[tuple[str, str], Cell] = {}
    for cell in given:
        place = (cell.fit.key, cell.evaluation.name)
        known = found.get(place, cell)
        found[place] = max(known, cell, key=lambda other: other.episodes)
    return list(found.values())


def _check_configs(found: Iterable[Cell]) -> None:
    """Builds every method, which raises an error if it refuses its config."""
    fits = (cell.fit for cell in found if cell.fit.method != EXPERT)
    for fit in {(f.task, f.method, f.variant, str(f.config)): f for f in fits}.values():
        with in_its_own_words(fit.method):
            fit.build()
