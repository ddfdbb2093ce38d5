"""Tasks keep every rule, and each kind of broken task breaks the rule that names its fault."""

import importlib
import sys
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from bench.new_package import write_package
from tasks.base import Task
from tasks.checks import RULES, check
from tasks.components import Component, Range
from tasks.masses import Change
from tasks.registry import get_task
from tasks.rule_results import RuleBrokenError

EXAMPLES = Path(__file__).parents[2] / "docs/examples"


@pytest.fixture(scope="module")
def press(tmp_path_factory):
    """The class of the task that `bench new-task` writes."""
    folder = tmp_path_factory.mktemp("packages") / "press"
    write_package("tasks.template", "press", folder)
    sys.path.insert(0, str(folder))
    yield importlib.import_module("press").Press
    sys.path.remove(str(folder))
    del sys.modules["press"]


@pytest.mark.parametrize("rule", RULES)
def test_the_task_that_new_task_writes_keeps_each_rule(press, rule):
    RULES[rule](press)


@pytest.mark.parametrize(
    "rule", [rule for rule in RULES if rule != "physics_touches_what_it_names"]
)
def test_a_task_of_the_suite_keeps_each_rule(rule):
    RULES[rule](type(get_task("door")))


def test_a_task_whose_episodes_end_early_keeps_the_rules_on_numbers_and_success():
    names = ("components_are_where_they_say", "success_judges_each_episode", "decided_is_final")
    for rule in names:
        RULES[rule](type(get_task("relocation")))


@pytest.mark.parametrize(
    "rule", ["declared", "components_are_where_they_say", "actuators_are_those_of_the_file"]
)
def test_the_example_on_the_shadow_hand_keeps_the_rules_on_its_model(rule, monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES / "shadow"))
    RULES[rule](importlib.import_module("shadow").Shadow)


def beyond(self, split, n, seed=0):
    starts = Task.sample(self, split, n, seed)
    starts.values[:, 0] *= 1.5
    return starts


def stretched(self, split, n, seed=0):
    starts = Task.sample(self, split, n, seed)
    starts.values[:] *= 1 - 0.5 / n
    return starts


def only_x(self, batch, values):
    batch.expand("body_pos")[:, batch.model.body("button").id, 0] = values[:, 0]


def random_place(self, batch, values):
    noise = 0.001 * np.random.default_rng().random(values.shape)
    batch.expand("body_pos")[:, batch.model.body("button").id, :2] = values + noise


def by_rank(self, batch):
    depth = batch.joint("depth").qpos[:, 0]
    return depth - depth.mean()


def damping(self, batch):
    batch.qvel[:] *= 0.999
    return batch.joint("depth").qpos[:, 0].copy()


def deepest(self, batch):
    depth = batch.joint("depth").qpos[:, 0].copy()
    before = getattr(self, "_deepest", depth)
    self._deepest = np.maximum(before if len(before) == len(depth) else depth, depth)
    return self._deepest.copy()


def tip_velocity(self, batch):
    place = batch.body("button").pos[:, :2]
    return np.concatenate([place, batch.joint("z").qvel], axis=1)


def above_average(self, readings):
    return readings[:, -1] > readings[:, -1].mean()


def in_place(self, readings):
    readings[:] = np.maximum.accumulate(readings, axis=1)
    return readings[:, -1] > 0.01


def ever(self, readings):
    return np.nanmax(readings, axis=1, initial=-1.0) > 0.01


def too_soon(self, readings, left):
    return readings[:, -1] > 0.01


def if_below(self, readings, left):
    return readings[:, -1] < -0.5


def idle(self):
    return Idle()


class Idle:
    def reset(self, simulator):
        self._count = len(simulator.starts)

    def act(self, simulator, step):
        return np.zeros((self._count, 3))


def stronger(self):
    spec = Task.specification(self)
    spec.actuators[0].gainprm[0] *= 2
    return spec


def wider(self):
    spec = Task.specification(self)
    spec.actuators[2].ctrlrange = [-0.25, 0.0]
    return spec


def slower(self):
    spec = Task.specification(self)
    spec.option.timestep = 0.001
    return spec


def nowhere_far(self, batch):
    place = batch.body("button").pos[:, :2].copy()
    place[np.abs(place[:, 0]) > 0.1] = np.nan
    return np.concatenate([place, batch.joint("depth").qpos], axis=1)


class Lost(Idle):
    def act(self, simulator, step):
        return np.full((self._count, 3), np.nan)


def stiff(self):
    spec = Task.specification(self)
    for actuator in spec.actuators:
        actuator.gainprm[0], actuator.biasprm[1] = 4e9, -4e9
    return spec


def without_mesh(self):
    spec = Task.specification(self)
    spec.add_mesh(name="nothing", file="nothing.obj")
    return spec


def weighs(name, value):
    return {"heavy_object": Change("body", (name,), "mass", value, "kg")}


BROKEN = [
    ("declared", {"specification": slower}, "timestep must be 0.002 s, got 0.001"),
    ("declared", {"robot_dim": 9}, "robot_dim must be 1 to 4"),
    ("declared", {"horizon": 1}, "horizon must be a whole number of 2 or more"),
    ("declared", {"in_distribution": Range((-0.1, 0.1), (0.1, -0.1))}, "below that of high"),
    ("answers", {"object_components": (Component("depth", "m", "qpos depth"),)}, "state returns"),
    ("answers", {"failure_modes": ("missed", "too little")}, "failed_by must return 1 array"),
    ("answers", {"object_state": nowhere_far}, "state is not finite at .*button_x from ood starts"),
    (
        "answers",
        {"expert": lambda self: Lost()},
        "action is not finite at .*action 0 from test starts",
    ),
    ("answers", {"specification": stiff}, "the simulation diverges in episode 0 from test starts"),
    ("declared", {"failure_modes": ("missed", "missed")}, "failure modes must differ"),
    ("declared", {"failure_modes": ("diverged", "missed")}, "failure modes must differ"),
    ("declared", {"sensors": ("nosuch",)}, "the model has no sensor 'nosuch'"),
    ("declared", {"out_of_distribution": Range((0.1, 0.1), (0.2, 0.2))}, "a tuple of ranges"),
    ("declared", {"specification": without_mesh}, "press.xml cannot be read: .*nothing.obj"),
    ("random_actions_fail", {"success": lambda self, r: r[:, -1] > -9}, "succeed from each of 6"),
    ("answers", {"success": lambda self, r: 1.0 * (r[:, -1] > 0.01)}, "booleans"),
    ("starts_in_range", {"sample": beyond}, "allowed is button_x in"),
    ("starts_in_range", {"sample": stretched}, "depend on how many are drawn"),
    ("starts_in_range", {"out_of_distribution": (Range((0.05, 0), (0.2, 0.1)),)}, "starts out of"),
    ("starts_show_in_the_state", {"place": only_x}, "another button_y gives the same first state"),
    ("same_start_same_episode", {"place": random_place}, "the states of the same episodes"),
    ("threads_and_grouping", {"read": by_rank}, "the readings of the same episodes"),
    ("reading_changes_nothing", {"read": damping}, "read changes positions, velocities"),
    ("reads_the_present", {"read": deepest}, "it remembers"),
    ("components_are_where_they_say", {"object_state": tip_velocity}, "depth is .*'qpos depth' is"),
    (
        "components_are_where_they_say",
        {"reading": Component("depth", "m", "qpos deep")},
        "'qpos deep' is not in the model",
    ),
    ("success_judges_each_episode", {"success": above_average}, "depends on the others"),
    ("success_judges_each_episode", {"success": in_place}, "writes to the readings"),
    ("decided_is_final", {"decided": too_soon}, "has another success than the whole one"),
    ("decided_is_final", {"decided": if_below}, "the readings that follow change it"),
    ("expert_demonstrates", {"expert": idle}, "succeeds from 0 of 40 starts"),
    ("physics_touches_what_it_names", {"changes": weighs("buton", 1.0)}, "no body 'buton'"),
    ("physics_touches_what_it_names", {"changes": weighs("button", 1.0)}, "does not change"),
    ("actuators_are_those_of_the_file", {"specification": stronger}, "gainprm of actuator 'to_x'"),
    ("actuators_are_those_of_the_file", {"specification": wider}, "ctrlrange of actuator 'to_z'"),
]


@pytest.mark.parametrize(
    ("rule", "change", "reason"), BROKEN, ids=[f"{r}-{reason}" for r, _, reason in BROKEN]
)
def test_a_broken_task_breaks_the_rule_that_names_its_fault(press, rule, change, reason):
    broken = type("Broken", (press,), change)
    with pytest.raises((RuleBrokenError, ValueError), match=reason):
        RULES[rule](broken)


def test_a_fault_is_reported_once(press):
    broken = type("Broken", (press,), {"horizon": 1})
    results = list(check(broken))
    assert [result.rule for result in results if result.tried] == ["declared"]
    assert {result.message for result in results if not result.tried} == {"needs declared"}


def test_a_task_of_a_single_control_step_keeps_the_rule_on_decisions(press):
    RULES["decided_is_final"](type("Short", (press,), {"horizon": 2}))


def test_success_that_is_certain_early_may_end_an_episode(press):
    early = type("Early", (press,), {"success": ever, "decided": too_soon_no_more})
    RULES["decided_is_final"](early)


def too_soon_no_more(self, readings, left):
    return np.nanmax(readings, axis=1) > 0.01


def test_a_change_of_mass_touches_the_body_that_has_one(press, tmp_path):
    """A mass of its own can be changed; one that follows from geoms cannot."""
    text = (files("tasks.template") / "NAME/NAME.xml.txt").read_text()
    mass = '<inertial pos="0 0 0" mass="0.05" diaginertia="1e-5 1e-5 1e-5"/>'
    file = tmp_path / "press.xml"
    file.write_text(
        text.replace(
            'gravcomp="1">\n      <joint name="depth"', f'gravcomp="1">{mass}<joint name="depth"'
        )
    )
    own = type("Own", (press,), {"model_path": file, "changes": weighs("button", 1.0)})
    RULES["physics_touches_what_it_names"](own)
