"""Describes experiments: what they measure, vary and compute."""

from dataclasses import dataclass
from typing import Any

from bench.controller_kinds import ABOUT as ABOUT_CONTROLLERS
from bench.experiments import EFFICIENCY_DEMOS, EXPERIMENTS
from bench.names import CONDITIONS
from bench.presets import PRESETS, Study
from bench.spec import VALIDATION, Cell


@dataclass(frozen=True)
class About:
    """The description of an experiment, beside what its cells say."""

    measures: str
    varies: str
    paper: tuple[str, ...] = ()
    """File names of the paper's tables and figures that show it in a report."""
    own: tuple[str, ...] = ()
    """File names of the other tables and figures that show it in a report."""


ABOUT = {
    "sizes": About(
        measures="Success of each method with each size of model. The best size of a method on a"
        " task is then used in all other experiments of the run.",
        varies="Task, method, size of model, seed.",
        paper=("table_1", "table_2", "table_3", "table_4", "table_5"),
    ),
    "success": About(
        measures="Success from unseen starts of the training distribution: the main comparison.",
        varies="Task, method, seed. The expert is evaluated from the same starts.",
        paper=("table_6",),
        own=(
            *("success", "all_tasks", "starts", "success_over_time", "motions", "beyond"),
            *("two_experts_test", "expert_change_test", "times"),
        ),
    ),
    "ood": About(
        measures="Success from starts outside the ranges of the training distribution.",
        varies="Task, method, seed. The expert is evaluated from the same starts.",
        paper=("figure_5",),
        own=("all_tasks", "starts", "beyond_ood", "two_experts_ood", "expert_change_ood"),
    ),
    "robustness": About(
        measures="Success with other masses of the hand or the object (appendix I).",
        varies="Task, method, seed, physics, and whether the controller was trained in the nominal"
        " or in the changed physics.",
        paper=("table_7", "table_8", "table_9", "table_10"),
    ),
    "lifting": About(
        measures="Success and imitation error of KODex with each set of observables (appendix J)."
        " Fit times need `bench time` too.",
        varies="Task, set of observables, seed.",
        paper=("table_11", "figure_6", "figure_6_time"),
    ),
    "stability": About(
        measures="The eigenvalues of KODex's matrix K, fitted to all training demonstrations.",
        varies="Task, seed.",
        paper=("table_12", "figure_7"),
        own=("rank",),
    ),
    "efficiency": About(
        measures="Success after training on few or many demonstrations, of which a method that"
        " chooses by validation holds out a fifth. Training times need `bench time` too.",
        varies="Task, method, seed, number of demonstrations"
        f" ({', '.join(map(str, EFFICIENCY_DEMOS))}).",
        own=("efficiency", "efficiency_time"),
    ),
    "disturbed": About(
        measures="Success when the hand starts off, the object lies elsewhere, something pushes,"
        " sensors have errors, or actions arrive late.",
        varies="Task, method, seed, disturbance and its strength. The expert meets the same, but"
        " for noise, since it reads other quantities.",
        own=("disturbed", "beyond_conditions", "behind_expert"),
    ),
    "closed_loop": About(
        measures="Success of methods that predict their motion anew from the present state on the"
        " way, in nominal and changed physics, and disturbed.",
        varies="Task, method, seed, how often a motion is predicted anew, physics, disturbance.",
        own=("closed_loop",),
    ),
    "variants": About(
        measures="Success of methods trained as the appendix describes, as the authors' code does,"
        " and in their other variants.",
        varies="Task, method, variant, seed.",
        own=("audit_variant",),
    ),
    "rules": About(
        measures="Success of the same episodes by the rules of the appendix and of the authors'"
        " code, on tasks where they differ.",
        varies="Task, method, seed, success rule.",
        own=("audit_rule",),
    ),
    "readings": About(
        measures="Success in changed physics, with appendix I read in other ways.",
        varies="Task, method, seed, reading.",
        own=("audit_physics",),
    ),
    "controllers": About(
        measures="Success with controllers that learn from something else or start elsewhere.",
        varies="Task, method, seed, controller, physics.",
        own=("audit_variant", "audit_physics"),
    ),
}

SPLITS = {
    VALIDATION: "starts of the validation demonstrations",
    "test": "unseen starts of the training distribution",
    "ood": "starts outside the training distribution",
}


def describe_experiment(name: str) -> dict[str, Any]:
    """Describes an experiment, with the conditions of the preset that has most cells of it."""
    about = ABOUT[name]
    cells = {preset: _cells(study, name) for preset, study in PRESETS.items()}
    evaluations = [cell.evaluation for cell in max(cells.values(), key=len)]
    splits, physics, controllers, rules, disturbances, replans = (
        list(dict.fromkeys(getattr(evaluation, field) for evaluation in evaluations))
        for field in CONDITIONS
    )
    return {
        "name": name,
        "measures": about.measures,
        "varies": about.varies,
        "splits": {split: SPLITS[split] for split in splits},
        "physics": physics,
        "controllers": {controller: ABOUT_CONTROLLERS[controller] for controller in controllers},
        "success_rules": rules,
        "disturbances": disturbances,
        "replans": replans,
        "exhibits": {"paper": list(about.paper), "own": list(about.own)},
        "presets": {
            preset: _counts(found, PRESETS[preset].episodes[name]) if found else None
            for preset, found in cells.items()
        },
    }


def _cells(study: Study, name: str) -> list[Cell]:
    return EXPERIMENTS[name](study, {}) if name in study.episodes else []


def _counts(cells: list[Cell], episodes: int) -> dict[str, int]:
    return {
        "fits": len({cell.fit.key for cell in cells}),
        "evaluations": len(cells),
        "episodes": episodes,
        "episodes_in_all": sum(cell.episodes for cell in cells),
    }
