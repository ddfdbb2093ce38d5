"""Prints digests of small computations, for an emulated processor, which is slow."""

from dataclasses import replace

from same_bits import SEED, sha256

from methods.guard import guarded
from methods.registry import SUITE, get_method
from methods.toy import LAYOUT, answer, toy
from tasks.data import FloatArray
from tasks.experts import load_expert
from tasks.files import to_bytes
from tasks.pins import pin
from tasks.registry import TASKS, get_task
from tasks.simulator import Policy, Simulator, rollout

STARTS = 2
NOT_EMULATED = ("lstm",)
"""The emulator crashes in the kernel that oneDNN writes for it as it runs."""


class Watched:
    """A policy that keeps the states that it sees."""

    def __init__(self, policy: Policy) -> None:
        self.policy = policy

    def reset(self, simulator: Simulator) -> None:
        self.states: list[FloatArray] = []
        self.policy.reset(simulator)

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        self.states.append(simulator.state().copy())
        return self.policy.act(simulator, step)


def episodes(task_name: str) -> str:
    """Returns a digest of all states of episodes of the expert."""
    task = get_task(task_name)
    expert = Watched(load_expert(task).policy)
    found = rollout(task, task.sample("test", STARTS, SEED), expert, chunk=STARTS, threads=1)
    return sha256(*(states.tobytes() for states in expert.states), found.readings.tobytes())


def fit(name: str) -> str:
    """Returns a digest of what a method learns from a few demonstrations, and of its answers."""
    kind = get_method(name)
    config = next(iter(kind.sizes.values()))
    if hasattr(config, "epochs"):
        config = replace(config, epochs=2)
    with guarded(name):
        method = kind(config, LAYOUT)
        method.fit(toy(10, 20), toy(30, 5), SEED)
        return sha256(to_bytes(method.parameters()), answer(method).tobytes())


if __name__ == "__main__":
    print(pin())
    for task in TASKS:
        print("episodes", task, episodes(task), flush=True)
    for method in SUITE:
        if method not in NOT_EMULATED:
            print("fit", method, fit(method), flush=True)
