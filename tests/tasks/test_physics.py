import mujoco
import numpy as np
import pytest
from mujoco.batch import MODEL_FIELDS

from tasks.errors import InputError
from tasks.masses import CHANGES, PHYSICS, READINGS
from tasks.physics import changed_fields
from tasks.registry import TASKS, get_task
from tasks.simulator import Simulator, rollout

# Appendix I, with "palm" interpreted as the forearm and the pen's mass as its density in g/cm^3.
KNUCKLES = ["ffknuckle", "mfknuckle", "rfknuckle", "lfknuckle"]
MASSES_KG = {
    "tool": {"Object": (0.85, 0.10), "forearm": (1.0, 8.0)},
    "door": {"latch": (12.54, 0.54), "forearm": (1.5, 7.0)},
    "relocation": {"Object": (1.88, 0.05), "forearm": (3.0, 5.0)},
    "reorientation": dict.fromkeys(KNUCKLES, (0.0001, 0.20)),
}
DERIVED = {
    "actuator_acc0",
    "body_invweight0",
    "body_subtreemass",
    "cam_poscom0",
    "dof_M0",
    "dof_invweight0",
    "dof_length",
    "light_poscom0",
    "tendon_invweight0",
}


def model_bytes(model):
    buffer = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def differences(old, new):
    fields = [field for field in MODEL_FIELDS if not field.startswith("opt.")]
    return {f for f in fields if not np.array_equal(getattr(old, f), getattr(new, f))}


def variations(attribute):
    return [
        pytest.param(task, name, id=f"{task}-{name}")
        for task in TASKS
        for name, change in CHANGES[task].items()
        if change.attribute == attribute
    ]


@pytest.mark.parametrize(("name", "physics"), variations("mass"))
def test_a_mass_variation_changes_only_the_mass_and_constants_derived_from_it(name, physics):
    change, task = CHANGES[name][physics], get_task(name)
    model = task.specification().compile()
    for body in change.names:
        model.body(body).mass = change.value
    mujoco.mj_setConst(model, mujoco.MjData(model))
    fields = changed_fields(task, physics)
    assert set(fields) == differences(model, task.model) <= {"body_mass"} | DERIVED
    for field, values in fields.items():
        np.testing.assert_array_equal(getattr(model, field), values)
    heavier = np.flatnonzero(fields["body_mass"] != task.model.body_mass)
    assert {task.model.body(int(body)).name for body in heavier} == set(change.names)


@pytest.mark.parametrize(("name", "physics"), variations("density"))
def test_a_density_variation_changes_only_the_inertia_of_its_body(name, physics):
    task = get_task(name)
    fields = changed_fields(task, physics)
    inertial = {"body_mass", "body_inertia", "body_ipos", "body_iquat"}
    # bounding volumes are kept in the frame of the body's inertia
    assert inertial <= set(fields) <= inertial | DERIVED | {"bvh_aabb", "body_sameframe"}
    pen = task.model.body("Object").id
    for field in inertial:
        changed = (fields[field] != getattr(task.model, field)).reshape(task.model.nbody, -1)
        assert np.flatnonzero(changed.any(axis=1)).tolist() == [pen]


def test_masses_match_appendix_i(task):
    for body, values in MASSES_KG[task.name].items():
        hand = body in ("forearm", *KNUCKLES)
        names = ("light_hand", "heavy_hand") if hand else ("heavy_object", "light_object")
        for physics, value in zip(names, values, strict=True):
            simulator = Simulator(task, task.sample("test", 2), physics)
            for episode in range(2):
                assert simulator.batch.get_model(episode).body(body).mass == value


@pytest.mark.parametrize(("physics", "density"), [("heavy_object", 9500), ("light_object", 200)])
def test_the_mass_of_the_pen_follows_from_its_density(physics, density):
    task = get_task("reorientation")
    pen = task.model.body("Object").id
    shaft = np.pi * 0.015**2 * 0.13
    nominal = task.model.body_mass[pen]
    expected = nominal + (density - 1500) * shaft
    masses = changed_fields(task, physics)["body_mass"]
    np.testing.assert_allclose(masses[pen], expected, rtol=1e-9)
    np.testing.assert_allclose(nominal, 0.182, atol=5e-4)


@pytest.mark.parametrize("task", ["tool", "door", "relocation"], indirect=True)
@pytest.mark.parametrize("weight", ["light", "heavy"])
def test_palm_variations_scale_the_palm_by_the_factor_of_the_forearm(task, weight):
    nominal = task.model.body_mass
    hand, other = (changed_fields(task, f"{weight}_{n}")["body_mass"] for n in ("hand", "palm"))
    forearm, palm = (task.model.body(name).id for name in ("forearm", "palm"))
    assert other[palm] / nominal[palm] == pytest.approx(hand[forearm] / nominal[forearm], rel=1e-5)
    np.testing.assert_array_equal(np.delete(other, palm), np.delete(nominal, palm))


@pytest.mark.parametrize(
    ("name", "physics"),
    [(task, name) for task in TASKS for name in READINGS[task] if name.endswith("_inertia")],
)
def test_inertia_variations_scale_inertia_with_mass(name, physics):
    task, change = get_task(name), READINGS[name][physics]
    fields, alone = (changed_fields(task, p) for p in (physics, physics.removesuffix("_inertia")))
    np.testing.assert_array_equal(fields["body_mass"], alone["body_mass"])
    for body in change.names:
        row = task.model.body(body).id
        grown = task.model.body_inertia[row] * change.value / task.model.body_mass[row]
        np.testing.assert_allclose(fields["body_inertia"][row], grown)
    assert "body_inertia" not in alone


def test_variations_leave_the_nominal_model_unchanged(task):
    before = model_bytes(task.model)
    starts = task.sample("test", 3)
    for physics in task.physics:
        simulator = Simulator(task, starts, physics)
        simulator.step(np.zeros((3, task.layout.action_dim)))
    assert model_bytes(task.model) == before
    assert model_bytes(task.specification().compile()) == before


@pytest.mark.parametrize("density", [9500, 200])
def test_a_pen_of_another_density_moves_like_one_compiled_with_it(density, random_replay):
    task = get_task("reorientation")
    physics = "heavy_object" if density > 1500 else "light_object"
    spec = mujoco.MjSpec.from_file(str(task.model_path))
    spec.geom("pen").density = density
    model = spec.compile()
    model.actuator_gainprm[:] = task.model.actuator_gainprm
    model.actuator_biasprm[:] = task.model.actuator_biasprm
    data = mujoco.MjData(model)
    starts, policy = task.sample("test", 1), random_replay(task, 1)
    simulator = Simulator(task, starts, physics)
    policy.reset(simulator)
    for step in range(task.horizon - 1):
        simulator.step(policy.act(simulator, step))
        data.ctrl = simulator.batch.ctrl[0]
        mujoco.mj_step(model, data, nstep=5)
        np.testing.assert_array_equal(simulator.batch.qpos[0], data.qpos)


def test_each_variation_changes_the_motion_differently(task, random_replay):
    starts, policy = task.sample("test", 3), random_replay(task, 3)

    def trace(physics):
        simulator = Simulator(task, starts, physics)
        policy.reset(simulator)
        for step in range(40):
            simulator.step(policy.act(simulator, step))
        return simulator.state().tobytes()

    traces = [trace(physics) for physics in PHYSICS]
    assert len(set(traces)) == len(PHYSICS)
    assert trace("nominal") == traces[0]


def test_an_unknown_variation_is_refused_with_the_nearest_name(task, random_replay):
    with pytest.raises(InputError, match=r"heavy_object, .*did you mean 'heavy_hand'"):
        rollout(task, task.sample("test", 1), random_replay(task, 1), physics="heavy_hnad")
