"""A program that runs a study of a few seconds and writes its tables: every method, a controller.

It also begins to train an expert.

Usage: tiny_study.py FOLDER
"""

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from bench import driver
from bench.backend import IN_THIS_PROCESS, Workers
from bench.controller import ControllerConfig
from bench.presets import PRESETS
from methods.registry import SUITE, get_method
from reports.exhibits import EXHIBITS
from reports.results import Results
from tasks import demos, expert_training, recorder
from tasks.checkpoints import expert_weights, read_checkpoint
from tasks.files import to_bytes
from tasks.registry import get_task


def has_epochs(name: str) -> bool:
    """Whether a method is trained in epochs."""
    return all(hasattr(config, "epochs") for config in get_method(name).sizes.values())


def main(folder: Path) -> None:
    demos.TRAINING, demos.VALIDATION, recorder.BLOCK = 6, 2, 10
    driver.TRAINING = 6
    study = replace(
        PRESETS["smoke"],
        episodes={"success": 6, "ood": 6, "stability": 6},
        methods=SUITE,
        demos=6,
        controller=ControllerConfig(epochs=2),
        settings={(name, "epochs"): 2 for name in SUITE if has_epochs(name)},
    )
    outcome = driver.run(study, folder, Workers(1, IN_THIS_PROCESS))
    assert outcome.failed == ()
    assert "torch._dynamo" not in sys.modules, (
        "training loads torch's compiler, which takes seconds"
    )
    (folder / "tables").mkdir()
    results = Results(folder)
    for exhibit in EXHIBITS:
        table = exhibit.table(results)
        table.to_csv(folder / "tables" / f"{exhibit.name}.csv", index=False)
    begin_expert(folder / "expert.safetensors")


def begin_expert(path: Path) -> None:
    """Trains an expert for one iteration and writes its weights."""
    door = get_task("door")
    short = replace(door.recipe, steps=1, episodes=16)
    expert_training.recipe_of = lambda task: short
    with TemporaryDirectory() as training:
        expert_training.train(door, Path(training), lambda row: None)
        path.write_bytes(to_bytes(expert_weights(read_checkpoint(Path(training))[0])))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
