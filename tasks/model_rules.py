"""The rules on the class and the model of a task, one function per rule, see `tasks.rules`."""

import mujoco
import numpy as np

from tasks.base import DIVERGED, Task
from tasks.components import Range
from tasks.data import CONTROL_STEP
from tasks.masses import NOMINAL, Change
from tasks.names import check_name
from tasks.rule_results import NotAskedError, require
from tasks.simulator import SUBSTEPS, Simulator

TOLERANCE = 1e-9
"""Largest difference between two ways to compute the same number."""
_PLAIN = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
"""The types of joints with one position."""
_ACTUATOR = (
    *("trntype", "dyntype", "gaintype", "biastype", "dynprm", "gear", "ctrlrange"),
    *("gainprm", "biasprm"),
)
"""Fields of an actuator that decide its force."""


def declared(task: Task) -> None:
    """The class describes the task, and its model can be simulated in control steps of 10 ms."""
    if not type(task).__module__.startswith("tasks."):
        check_name("task", task.name)
    for name in ("summary", "rule"):
        text = getattr(task, name)
        require(isinstance(text, str) and text, f"{name} must be a text, got {text!r}")
    horizon, joints = task.horizon, task.robot_dim
    require(
        isinstance(horizon, int) and horizon > 1,
        f"horizon must be a whole number of 2 or more states, got {horizon!r}",
    )
    require(task.failure_modes, "failure_modes must name at least one")
    modes = (DIVERGED, *task.failure_modes)
    require(len(set(modes)) == len(modes), f"failure modes must differ, and from {DIVERGED!r}")
    model = task.model
    for sensor in task.sensors:
        require(
            mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, sensor) >= 0,
            f"sensors: the model has no sensor {sensor!r}",
        )
    require(
        isinstance(joints, int) and 0 < joints <= model.njnt,
        f"robot_dim must be 1 to {model.njnt}, the joints of the model, got {joints!r}",
    )
    for joint in (model.joint(i) for i in range(task.robot_dim)):
        require(joint.name, f"joint {joint.id} of the hand needs a name")
        require(
            joint.type[0] in _PLAIN, f"joint {joint.name!r} of the hand must be a hinge or a slide"
        )
    step = SUBSTEPS * model.opt.timestep
    require(
        abs(step - CONTROL_STEP) < TOLERANCE,
        f"the model's timestep must be {CONTROL_STEP / SUBSTEPS:g} s, got {model.opt.timestep:g}",
    )
    require(model.nu, "the model has no actuators")
    for actuator in (model.actuator(i) for i in range(model.nu)):
        low, high = actuator.ctrlrange
        require(
            actuator.ctrllimited[0] and low < high,
            f"actuator {actuator.name!r} needs a ctrlrange: actions from -1 to 1 are scaled to it",
        )
    names = [component.name for component in task.components]
    require(len(set(names)) == len(names), f"two numbers of the state have one name: {names}")
    boxes = task.out_of_distribution
    require(
        isinstance(boxes, tuple) and all(isinstance(box, Range) for box in boxes),
        f"out_of_distribution must be a tuple of ranges, got {boxes!r}",
    )
    for box in (task.in_distribution, *boxes):
        width = len(task.start_components)
        require(
            len(box.low) == len(box.high) == width and np.all(np.less(box.low, box.high)),
            f"a range of starts needs {width} numbers low, each below that of high: {box}",
        )
    require(boxes, "out_of_distribution needs a range")
    require(task.model_hash, "the files of the model must be found")


def physics_touches_what_it_names(task: Task) -> None:
    """Each of `changes` gives the named elements the named value, and no others."""
    if not task.changes:
        raise NotAskedError("the class has no `changes`")
    for name, change in task.changes.items():
        require(name != NOMINAL, f"a change must not have the name {NOMINAL!r}")
        _check_change(task, name, change)


def actuators_are_those_of_the_file(task: Task) -> None:
    """The model's actuators are those of its file, but for the gains of `servo_gain`."""
    ours = task.model
    file = mujoco.MjModel.from_xml_path(str(task.model_path))
    names = [[model.actuator(i).name for i in range(model.nu)] for model in (ours, file)]
    require(names[0] == names[1], f"the actuators are {names[0]}, in the file {names[1]}")
    for i, name in enumerate(names[0]):
        gain = task.servo_gain(name)
        wanted = {field: getattr(file, f"actuator_{field}")[i] for field in _ACTUATOR}
        if gain is not None:
            wanted["gainprm"], wanted["biasprm"] = np.zeros((2, len(wanted["gainprm"])))
            wanted["gainprm"][0], wanted["biasprm"][1] = gain, -gain
        for field, value in wanted.items():
            got = getattr(ours, f"actuator_{field}")[i]
            require(
                np.array_equal(got, value),
                f"{field} of actuator {name!r} is {np.trim_zeros(np.ravel(got), 'b')}, in the file"
                f" {np.trim_zeros(np.ravel(value), 'b')}",
            )


def _check_change(task: Task, name: str, change: Change) -> None:
    spec = task.specification()
    bodies = []
    for one in change.names:
        element = getattr(spec, change.element)(one)
        require(element is not None, f"{name}: the model has no {change.element} {one!r}")
        bodies.append(one if change.element == "body" else element.parent.name)
    simulator = Simulator(task, task.sample("test", 1, 1), name, threads=1)
    changed, nominal = simulator.batch.get_model(0), task.model
    for body in (nominal.body(i).name for i in range(nominal.nbody)):
        before, after = (float(model.body(body).mass[0]) for model in (nominal, changed))
        if body not in bodies:
            require(
                before == after, f"{name} changes the mass of body {body!r}, which it names not"
            )
            continue
        require(before != after, f"{name} does not change the mass of body {body!r}, {before:g} kg")
        as_said = change.attribute != "mass" or abs(after - change.value) <= TOLERANCE
        require(as_said, f"{name}: body {body!r} weighs {after:g} kg, not {change.value:g}")
