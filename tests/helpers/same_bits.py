"""What demonstrations, controller and fits of seed 1 must hash to on every processor.

`python tests/helpers/same_bits.py` computes all of it, compares it with ``same_bits.json`` and
notes the processor there; with ``--new`` it writes the digests anew.
"""

import hashlib
import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from bench.controller import ControllerConfig, train_controller
from bench.provenance import software
from methods.guard import guarded
from methods.registry import SUITE, get_method
from methods.toy import answer
from tasks.demos import TRAINING, VALIDATION, split
from tasks.experts import load_expert
from tasks.files import to_bytes
from tasks.pins import pin, processor
from tasks.recorder import make_demos
from tasks.registry import TASKS, get_task

FILE = Path(__file__).with_suffix(".json")
SEED = 1
DEMOS, EPOCHS = 20, 2
"""Of each network: enough for every kernel to be called."""
SIZES = {
    "nn": ("small", "median", "median", "large"),
    "lstm": ("large", "small", "large", "median"),
    "ndp": ("small", "median", "median", "median"),
    "ngf": ("small", "median", "small", "small"),
}
"""By method, a size for each of `TASKS`. Other methods have their smallest."""


def digests(task_name: str, controller: bool = True) -> Iterator[tuple[str, str]]:
    """Yields the name and SHA-256 of each thing, computed from nothing."""
    task = get_task(task_name)
    with guarded("demonstrations"):
        demos = make_demos(task, load_expert(task).policy, TRAINING + VALIDATION, SEED, threads=1)
    arrays = (demos.starts.values, demos.states, demos.velocities, demos.actions)
    yield "demonstrations", sha256(*(a.tobytes() for a in arrays))
    training, validation = split(demos)
    for name in SUITE:
        kind = get_method(name)
        size = SIZES[name][TASKS.index(task_name)] if name in SIZES else next(iter(kind.sizes))
        config, learnt_from = kind.sizes[size], training
        if hasattr(config, "epochs"):
            config, learnt_from = replace(config, epochs=EPOCHS), training[:DEMOS]
        with guarded(name):
            method = kind(config, task.layout)
            method.fit(learnt_from, validation, SEED)
            answers = answer(method, validation)
        yield name, sha256(to_bytes(method.parameters()))
        yield f"{name} answers", sha256(answers.tobytes())
    if controller:
        with guarded("controller"):
            weights = train_controller(ControllerConfig(), training, task_name, SEED)
        yield "controller", sha256(to_bytes(weights))


def sha256(*contents: bytes) -> str:
    return hashlib.sha256(b"".join(contents)).hexdigest()


def expected() -> dict[str, dict[str, str]]:
    """Returns by task and name what the digests must be."""
    return json.loads(FILE.read_text())["sha256"]


def main(new: bool) -> None:
    """Compares, or writes, and notes this processor."""
    if pin().why_not:
        sys.exit(f"not pinned: {pin().why_not}")
    found = {task: dict(digests(task)) for task in TASKS}
    seen = [] if new else json.loads(FILE.read_text())["seen"]
    differ = [
        f"{task}: {name}"
        for task, values in ({} if new else expected()).items()
        for name, value in values.items()
        if found[task].get(name) != value
    ]
    if differ:
        sys.exit(f"{processor()[0]} differs: {', '.join(differ)}")
    name, features = processor()
    wide = "with" if "avx512f" in features else "without"
    place = {"processor": f"{name}, {wide} AVX-512", **software()}
    seen += [place] if place not in seen else []
    FILE.write_text(json.dumps({"seen": seen, "sha256": found}, indent=1) + "\n")


if __name__ == "__main__":
    main("--new" in sys.argv)
