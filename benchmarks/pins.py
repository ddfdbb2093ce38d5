"""What pinned kernels cost: CPU time of each training with and without them, as ratios.

`python benchmarks/pins.py` runs each in processes of their own, in turns, on Door. Put
``LD_PRELOAD`` into the environment to measure it for a processor that libraries are made to find.
"""

import json
import os
import subprocess
import sys
from dataclasses import replace
from statistics import median
from time import process_time

from tasks.pins import PINS, SWITCH

TURNS, DEMOS = 5, 60
EPOCHS = {"nn": 5, "lstm": 10, "ndp": 20, "ngf": 1}


def main() -> None:
    seconds: dict[str, list[dict[str, float]]] = {"on": [], "off": []}
    for _ in range(TURNS):
        for switch, found in seconds.items():
            free = {name: value for name, value in os.environ.items() if name not in PINS}
            environment = free | {SWITCH: switch, "OMP_NUM_THREADS": "1"}
            command = [sys.executable, __file__, "measure"]
            done = subprocess.run(command, env=environment, capture_output=True, check=True)
            found.append(json.loads(done.stdout))
    print("what,pinned,unpinned,ratio")
    for name in seconds["on"][0]:
        on, off = (median(one[name] for one in seconds[switch]) for switch in ("on", "off"))
        print(f"{name},{on:.2f},{off:.2f},{on / off:.2f}")


def measure() -> dict[str, float]:
    """Returns CPU seconds by name."""
    from bench.controller import ControllerConfig, train_controller
    from bench.machine import warm_up
    from methods.guard import guarded
    from methods.registry import PAPER, get_method
    from tasks.demos import load_demos, split
    from tasks.experts import load_expert
    from tasks.registry import get_task
    from tasks.simulator import rollout

    task = get_task("door")
    training, validation = split(load_demos(task))
    demos, found = training[:DEMOS], {}
    with guarded("pins"):
        warm_up()
        for name in PAPER:
            kind = get_method(name)
            config = kind.sizes[kind.default_size["door"]]
            if name in EPOCHS:
                config = replace(config, epochs=EPOCHS[name])
            began = process_time()
            kind(config, task.layout).fit(demos, validation, 1)
            found[name] = process_time() - began
        began = process_time()
        train_controller(ControllerConfig(epochs=20), demos, "door", 1)
        found["controller"] = process_time() - began
        began = process_time()
        rollout(task, task.sample("train", 100), load_expert(task).policy, threads=1, whole=True)
        found["expert's episodes"] = process_time() - began
    return found


if __name__ == "__main__":
    print(json.dumps(measure())) if "measure" in sys.argv else main()
