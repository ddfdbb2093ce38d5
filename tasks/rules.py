"""The rules on the episodes of a task, one function per rule. `tasks.checks` runs them.

A rule raises `RuleBrokenError` with the reason.
"""

import re
from collections.abc import Iterator

import mujoco
import numpy as np

from tasks.arrays import Replay
from tasks.base import SPLITS, Task
from tasks.components import Component
from tasks.data import FloatArray, IntArray, generator
from tasks.experts import experts_of, load_expert
from tasks.model_rules import TOLERANCE
from tasks.observed import COUNT, Seen, Wander, observe, policies, seen
from tasks.recorder import record
from tasks.rule_results import NotAskedError, RuleBrokenError, require
from tasks.simulator import Simulator, rollout

STARTS = 200
"""Number of starts of a split that are drawn."""
TRIED = 40
"""Number of starts that the expert tries."""
COMPLETIONS = 8
"""Number of random sequences of readings that could follow a decision."""
_SOURCE = re.compile(
    r"(qpos|qvel|xpos|body_pos|site_xpos|site_pos|sensordata) ([\w:]+)(?:, ([xyz]))?"
)


def answers(task: Task) -> None:
    """States, readings, success and failure modes are finite arrays, a row for each episode."""
    simulator = Simulator(task, task.sample("test", COUNT, 1), threads=1)
    for name, array, *width in (
        ("state", simulator.state(), task.layout.state_dim),
        ("read", task.read(simulator.batch)),
        ("watch", task.watch(simulator.batch), len(task.watched)),
    ):
        wanted = (COUNT, *width)
        require(array.shape == wanted, f"{name} returns {array.shape} numbers, not {wanted}")
        require(np.isfinite(array).all(), f"{name} returns numbers that are not finite")
    success = task.success(np.zeros((COUNT, task.steps)))
    require(
        success.shape == (COUNT,) and success.dtype == np.bool_,
        f"success must return {COUNT} booleans for {COUNT} episodes, got {success.dtype}"
        f" {success.shape}",
    )
    for split in ("test", "ood"):
        for found in seen(task, split):
            _check_finite(task, found, split)
    found = seen(task)[0]
    others = task.failed_by(found.after_steps, found.watched[:, 1:])
    named = len(task.failure_modes) - 1
    require(
        len(others) == named and all(one.shape == (COUNT,) for one in others),
        f"failed_by must return {named} arrays (B,), one for each failure mode but the last",
    )


def starts_in_range(task: Task) -> None:
    """Every start lies in the range of its split, and none out of distribution in the other's."""
    for split in SPLITS:
        starts = task.sample(split, STARTS, 1)
        task.check_starts(starts)
        fewer = task.sample(split, STARTS // 4, 1).values
        require(
            np.array_equal(fewer, starts.values[: len(fewer)]),
            f"the first starts of {split} depend on how many are drawn",
        )
    inside = task.in_distribution.contains(task.sample("ood", STARTS, 1).values)
    require(
        not inside.any(),
        f"{inside.sum()} of {STARTS} starts out of distribution lie in in_distribution",
    )


def starts_show_in_the_state(task: Task) -> None:
    """Each number of a start changes the first state: methods see nothing else of a start."""
    starts = task.sample("test", COUNT, 1)
    others = task.sample("test", 2 * COUNT, 1).values[COUNT:]
    first = Simulator(task, starts, threads=1).state()
    for place, component in enumerate(task.start_components):
        moved = task.sample("test", COUNT, 1)
        moved.values[:, place] = others[:, place]
        same = (Simulator(task, moved, threads=1).state() == first).all(axis=1)
        require(not same.any(), f"another {component.name} gives the same first state")


def same_start_same_episode(task: Task) -> None:
    """The same actions from the same start give the same bits again."""
    starts = task.sample("test", COUNT, 1)
    for make, before in zip(policies(task), seen(task), strict=True):
        _same(observe(task, starts, make()), before, "a second time")


def threads_and_grouping(task: Task) -> None:
    """Neither threads nor the other episodes of a batch change a bit of an episode."""
    starts, last, alone = task.sample("test", COUNT, 1), np.arange(COUNT)[::-1], np.array([1])
    for before in seen(task):
        again = Replay(before.actions)
        _same(observe(task, starts, again, threads=3), before, "on three threads")
        _same(observe(task, starts[last], again), _rows(before, last), "in reverse order")
        _same(observe(task, starts[alone], again), _rows(before, alone), "alone")


def reading_changes_nothing(task: Task) -> None:
    """`object_state`, `read`, `watch` and `observe` leave the simulation as it is."""
    simulator = Simulator(task, task.sample("test", COUNT, 1), threads=1)
    wander, batch = Wander(), simulator.batch
    wander.reset(simulator)
    for step in range(min(5, task.steps)):
        before = [field.copy() for field in (batch.qpos, batch.qvel, batch.ctrl)]
        for name in ("object_state", "read", "watch", "observe"):
            getattr(task, name)(batch)
            after = (batch.qpos, batch.qvel, batch.ctrl)
            same = all(map(np.array_equal, before, after))
            require(same, f"{name} changes positions, velocities or controls")
        simulator.step(wander.act(simulator, step))


def reads_the_present(task: Task) -> None:
    """States and readings depend on the present positions and velocities alone."""
    starts = task.sample("test", COUNT, 1)
    for found in seen(task):
        for moment in (task.steps, task.steps // 2, 1):
            simulator = Simulator(task, starts, threads=1)
            simulator.batch.qpos[:] = found.positions[:, moment]
            simulator.batch.qvel[:] = found.velocities[:, moment]
            simulator.refresh()
            for name, now, then in (
                ("state", simulator.state(), found.states[:, moment]),
                ("read", task.read(simulator.batch), found.readings[:, moment]),
            ):
                require(
                    np.array_equal(now, then),
                    f"{name} differs for the same positions and velocities by"
                    f" {np.abs(now - then).max():.2g}: it remembers, or reads a field of the"
                    " simulation that is not in derived_fields or is not kept current",
                )


def components_are_where_they_say(task: Task) -> None:
    """Numbers of states and readings equal what their `source` names, in a plain simulation."""
    sources = [*enumerate(task.components), (None, task.reading)]
    starts = task.sample("test", COUNT, 1)
    simulator = Simulator(task, starts, threads=1)
    for found in seen(task):
        for row, moment in ((0, 0), (1, task.steps // 2), (2, task.steps)):
            model = simulator.batch.get_model(row)
            data = mujoco.MjData(model)
            data.qpos, data.qvel = found.positions[row, moment], found.velocities[row, moment]
            mujoco.mj_forward(model, data)
            for place, component in sources:
                read = found.readings if place is None else found.states[:, :, place]
                wanted, got = _sourced(component, model, data), float(read[row, moment])
                if wanted is not None and abs(wanted - got) > TOLERANCE:
                    raise RuleBrokenError(
                        f"{component.name} is {got:.6g}, but {component.source!r} is {wanted:.6g}"
                    )


def success_judges_each_episode(task: Task) -> None:
    """Success of an episode depends on its own readings alone, and does not change them."""
    readings = np.concatenate([found.after_steps for found in seen(task)])
    kept, together = readings.copy(), task.success(readings)
    alone = np.concatenate([task.success(row[None]) for row in readings])
    require(np.array_equal(together, alone), "success of an episode depends on the others")
    require(np.array_equal(kept, readings), "success writes to the readings")


def random_actions_fail(task: Task) -> None:
    """Random actions fail from at least one start: else success says nothing of a method."""
    success = seen(task)[0].success
    require(not success.all(), f"random actions succeed from each of {len(success)} starts")


def decided_is_final(task: Task) -> None:
    """Once `decided`, no further reading changes success; nor does it that the episode ends."""
    starts = task.sample("test", COUNT, 1)
    for make, found in zip(policies(task), seen(task), strict=True):
        early = rollout(task, starts, make(), chunk=COUNT, threads=1)
        require(
            np.array_equal(early.success, found.success),
            "an episode that ends once decided has another success than the whole one",
        )
    for readings in _possible_readings(task):
        for count in range(1, task.steps):
            decided = task.decided(readings[:, :count], task.steps - count)
            rest = np.full((len(readings), task.steps - count), np.nan)
            ended = task.success(np.concatenate([readings[:, :count], rest], axis=1))
            differ = decided & (ended != task.success(readings))
            require(
                not differ.any(),
                f"decided says after {count} of {task.steps} steps that success is final, but the"
                " readings that follow change it",
            )


def expert_demonstrates(task: Task) -> None:
    """The expert, if there is one, succeeds from at least one start in ten."""
    if not experts_of(task):
        raise NotAskedError("the class has no `expert`")
    success, _ = record(task, task.sample("demo", TRIED, 1), load_expert(task).policy, threads=1)
    require(
        10 * success.sum() >= TRIED,
        f"the expert succeeds from {success.sum()} of {TRIED} starts, fewer than one in ten",
    )


def _same(now: Seen, before: Seen, when: str) -> None:
    """Raises RuleBrokenError with the first part in which episodes differ."""
    for name, value in vars(before).items():
        if not np.array_equal(getattr(now, name), value, equal_nan=True):
            raise RuleBrokenError(f"the {name} of the same episodes differ {when}")


def _check_finite(task: Task, found: Seen, split: str) -> None:
    """Raises RuleBrokenError with the first number of episodes that is not finite."""
    episode = int(np.argmax(found.diverged))
    taken = found.actions.shape[1]
    for name, numbers in (
        ("action", found.actions),
        ("state", found.states),
        ("read", found.readings[:, :, None]),
    ):
        bad = np.argwhere(~np.isfinite(numbers))
        require(
            not len(bad), f"{name} is not finite at {_place(task, name, bad)} from {split} starts"
        )
    require(
        not found.diverged.any(),
        f"the simulation diverges in episode {episode} from {split} starts, within {taken} steps:"
        " a model must bear random actions, and those of its expert",
    )


def _place(task: Task, name: str, places: IntArray) -> str:
    """The first of several places (N, 3): episode, control step and number."""
    episode, step, number = places[0] if len(places) else (0, 0, 0)
    named = {"read": task.reading.name, "action": f"action {number}"}
    component = named.get(name) or task.components[number].name
    return f"control step {step} of episode {episode}: {component}"


def _rows(found: Seen, rows: IntArray) -> Seen:
    return Seen(*(value[rows] for value in vars(found).values()))


def _sourced(component: Component, model: mujoco.MjModel, data: mujoco.MjData) -> float | None:
    """The number that a source names; None if it is not the plain name of one."""
    match = _SOURCE.fullmatch(component.source)
    if not match:
        return None
    field, name, axis = match.groups()
    try:
        if field in ("qpos", "qvel"):
            found = getattr(data.joint(name), field)
        elif field == "sensordata":
            found = data.sensor(name).data
        elif field == "xpos":
            found = data.body(name).xpos
        elif field == "site_xpos":
            found = data.site(name).xpos
        else:
            found = (model.body(name) if field == "body_pos" else model.site(name)).pos
    except KeyError as error:
        raise RuleBrokenError(
            f"{component.name}: {component.source!r} is not in the model"
        ) from error
    if len(found) == 1:
        return float(found[0])
    axis = axis or component.name[-1]
    return float(found["xyz".index(axis)]) if axis in "xyz" else None


def _possible_readings(task: Task) -> Iterator[FloatArray]:
    """Yields the readings (B, T-1) of observed episodes, and others of the same size."""
    for found in seen(task):
        readings = found.after_steps
        yield readings
        low, high = readings.min(), readings.max()
        ends = np.array([low - 1.0, low, 0.0, high, high + 1.0])
        for number in range(COMPLETIONS):
            rng = generator("readings", task.name, number)
            runs = np.repeat(rng.choice(ends, readings.shape), 1 + number, axis=1)
            yield np.where(rng.random((len(readings), 1)) < 0.5, runs[:, : task.steps], readings)
            begun = np.arange(task.steps) < rng.integers(1, max(task.steps, 2))
            yield np.where(begun, readings, rng.choice(ends, (len(readings), 1)))
