"""Ships the controllers of the preset ``quick``: ``python -m bench.ship_controllers [TASK ...]``.

`bench run quick` and `bench try` then need not train any. Those that neither the package nor the
cache has are trained, in minutes; files of other controllers of the tasks are removed.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from bench.computing import fit_controllers
from bench.experiments import cells_of
from bench.parsing import known_names
from bench.presets import get_preset
from bench.spec import ControllerSpec, controller_blocks
from bench.study_demos import demos_keys_of
from bench.trained import SHIPPED, TrainedController, file_name, trained, write
from bench.training_data import controller_demos
from tasks.registry import TASKS


def ship(tasks: Sequence[str], folder: Path = SHIPPED) -> list[ControllerSpec]:
    """Writes the controllers of tasks into a folder, by default the package's; returns them."""
    study = replace(get_preset("quick"), tasks=tuple(tasks))
    cells = cells_of(study, demos_keys_of(study))
    specs = list(
        {cell.controller.key: cell.controller for cell in cells if cell.controller}.values()
    )
    made = {spec.key: found for spec in specs if (found := trained(spec))}
    for block in controller_blocks(spec for spec in specs if spec.key not in made):
        fitted = fit_controllers(block, [controller_demos(spec) for spec in block])
        for spec, one in zip(block, fitted, strict=True):
            made[spec.key] = TrainedController(one.parameters, one.facts)
    for spec in specs:
        write(folder, spec, made[spec.key].weights, made[spec.key].facts)
    kept = {file_name(spec) for spec in specs}
    for task in tasks:
        for path in folder.glob(f"{task}-*"):
            if path.stem not in kept:
                path.unlink()
    return specs


if __name__ == "__main__":
    for spec in ship(known_names("TASKS", "task", ",".join(sys.argv[1:] or TASKS), TASKS)):
        print(spec.label)
