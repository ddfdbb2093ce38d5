import contextlib
import json
import os
import pickle
from pathlib import Path

import h5py
import numpy as np
import pytest

from tasks.data import Demos, generator
from tasks.errors import InputError
from tasks.minari import export_demos, import_demos
from tasks.simulator import Simulator

COUNT = 3


@pytest.fixture
def short(task, monkeypatch):
    """Shortens episodes, and makes all but the second succeed."""
    monkeypatch.setattr(type(task), "horizon", 6)
    monkeypatch.setattr(type(task), "success", lambda self, r: np.arange(len(r)) != 1)
    return task


@pytest.fixture
def recorded(short):
    """Demonstrations of random actions."""
    starts = short.sample("demo", COUNT)
    actions = generator("minari", short.name).uniform(-1, 1, (COUNT, 5, short.layout.action_dim))
    simulator = Simulator(short, starts)
    states, velocities = [], []
    for step in range(6):
        states.append(simulator.state())
        velocities.append(simulator.batch.qvel[:, : short.robot_dim].copy())
        if step < 5:
            simulator.step(actions[:, step])
    return Demos(starts, np.stack(states, 1), np.stack(velocities, 1), actions)


@pytest.fixture
def exported(short, recorded, tmp_path):
    export_demos(short, recorded, tmp_path / "set")
    return tmp_path / "set"


@pytest.fixture
def edit(exported):
    """Opens the exported file for writing."""
    return lambda: h5py.File(exported / "data" / "main_data.hdf5", "a")


def test_an_export_is_imported_bit_for_bit(short, recorded, exported):
    imported = import_demos(short, exported)
    assert imported.success.tolist() == [True, False, True]
    kept = recorded[np.array([0, 2])]
    np.testing.assert_array_equal(imported.demos.states, kept.states)
    np.testing.assert_array_equal(imported.demos.velocities, kept.velocities)
    np.testing.assert_array_equal(imported.demos.actions, kept.actions)
    np.testing.assert_allclose(imported.demos.starts.values, kept.starts.values, atol=1e-15)


def test_minari_reads_an_export(short, recorded, exported):
    from minari import MinariDataset

    dataset = MinariDataset(exported / "data")
    assert dataset.total_episodes == COUNT
    for row, episode in enumerate(dataset.iterate_episodes()):
        np.testing.assert_array_equal(episode.observations, recorded.states[row])
        np.testing.assert_array_equal(episode.actions, recorded.actions[row])


def test_an_import_replays_from_the_recorded_initial_state(short, exported, edit):
    with edit() as file:
        qpos = file["episode_0"].attrs["options/initial_state_dict/qpos"]
        qpos[3] += 0.1
        file["episode_0"].attrs["options/initial_state_dict/qpos"] = qpos
    states = import_demos(short, exported).demos.states
    assert states[0, 0, 3] == qpos[3]


def test_a_longer_episode_is_cut_to_the_horizon(short, recorded, exported, edit):
    """Public data sets have 200 steps, actions in single precision and no index of a start."""
    with edit() as file:
        actions = np.tile(recorded.actions[0], (40, 1)).astype(np.float32)
        del file["episode_0/actions"], file["episode_0"].attrs["options/start"]
        file["episode_0"].create_dataset("actions", data=actions, compression="gzip")
    imported = import_demos(short, exported)
    np.testing.assert_array_equal(imported.demos.actions[0], actions[:5])


class Evil:
    def __reduce__(self):
        return os.mkdir, ("executed",)


def poison_pickle(file):
    payload = np.frombuffer(pickle.dumps(Evil()), np.uint8)
    del file["episode_1/actions"]
    file["episode_1"]["actions"] = np.void(payload.tobytes())


def external_link(file):
    del file["episode_1"]
    file["episode_1"] = h5py.ExternalLink("/etc/passwd", "/")


def soft_link(file):
    del file["episode_1/actions"]
    file["episode_1/actions"] = h5py.SoftLink("/episode_0/actions")


def external_storage(file):
    shape = file["episode_1/actions"].shape
    del file["episode_1/actions"]
    size = int(np.prod(shape)) * 8
    file["episode_1"].create_dataset(
        "actions", shape, np.float64, external=[("/etc/passwd", 0, size)]
    )


def huge(file):
    width = file["episode_1/actions"].shape[1]
    del file["episode_1/actions"]
    file["episode_1"].create_dataset("actions", (2**40, width), np.float64, chunks=(1, width))


def not_finite(file):
    file["episode_1/actions"][2, 1] = np.nan


def too_short(file):
    file["episode_1/actions"].resize(4, axis=0)


def no_state(file):
    del file["episode_1"].attrs["options/initial_state_dict/qvel"]


def wrong_state(file):
    file["episode_1"].attrs["options/initial_state_dict/qpos"] = np.zeros(5)


def text_state(file):
    file["episode_1"].attrs["options/initial_state_dict/qpos"] = "import os"


def missing(file):
    del file["episode_2"]


def group_for_actions(file):
    del file["episode_1/actions"]
    file["episode_1"].create_group("actions")


ATTACKS = {
    poison_pickle: "at least",
    external_link: "no 'episode_1' of its own",
    soft_link: "no 'actions' of its own",
    external_storage: "not a plain array",
    huge: "too large",
    not_finite: "not finite",
    too_short: "at least 5 actions",
    no_state: "lacks the attribute",
    wrong_state: "must be",
    text_state: "must be",
    missing: "no 'episode_2' of its own",
    group_for_actions: "must be a dataset",
}


@pytest.mark.parametrize("task", ["door"], indirect=True)
@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack.__name__)
def test_a_malicious_or_damaged_file_is_refused(short, exported, edit, attack, monkeypatch):
    with edit() as file:
        attack(file)
    monkeypatch.chdir(exported)
    before = sorted(exported.rglob("*"))
    with pytest.raises(InputError, match=ATTACKS[attack]):
        import_demos(short, exported)
    assert sorted(exported.rglob("*")) == before


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_random_damage_is_refused_or_harmless(short, exported):
    path = exported / "data" / "main_data.hdf5"
    sound = path.read_bytes()
    rng = generator("damage")
    for _ in range(60):
        damaged = bytearray(sound[: rng.integers(len(sound))] if rng.random() < 0.3 else sound)
        for position in rng.integers(len(damaged) or 1, size=3):
            damaged[position : position + 1] = rng.bytes(1)
        path.write_bytes(damaged)
        with contextlib.suppress(InputError):
            import_demos(short, exported)


@pytest.mark.parametrize("task", ["door"], indirect=True)
@pytest.mark.parametrize("total", [0, -1, 10**9, "3", None, True])
def test_an_impossible_number_of_episodes_is_refused(short, exported, total):
    path = exported / "data" / "metadata.json"
    path.write_text(json.dumps({"total_episodes": total}))
    with pytest.raises(InputError, match="total_episodes"):
        import_demos(short, exported)


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_an_environment_named_in_the_metadata_is_not_built(short, exported):
    path = exported / "data" / "metadata.json"
    metadata = json.loads(path.read_text())
    for name in ("observation_space", "action_space"):
        del metadata[name]
    metadata["env_spec"] = json.dumps({"id": "x-v0", "entry_point": "os:abort", "kwargs": {}})
    path.write_text(json.dumps(metadata))
    assert len(import_demos(short, exported).success) == COUNT


def test_a_folder_without_a_data_set_is_refused(short, tmp_path):
    with pytest.raises(InputError, match="not a Minari data set"):
        import_demos(short, tmp_path)


def test_an_export_to_an_existing_folder_is_refused(short, recorded, tmp_path):
    with pytest.raises(InputError, match="exists"):
        export_demos(short, recorded, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("task", ["door"], indirect=True)
@pytest.mark.parametrize("name", ["set", "../set", "a/set"])
def test_an_export_to_a_relative_folder_works(short, recorded, tmp_path, monkeypatch, name):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    export_demos(short, recorded, Path(name))
    assert import_demos(short, Path(name)).success.tolist() == [True, False, True]


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_failed_export_leaves_nothing(short, recorded, tmp_path, monkeypatch):
    def fail(*arguments):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("tasks.minari.MinariStorage.update_metadata", fail)
        with pytest.raises(OSError, match="No space left"):
            export_demos(short, recorded, tmp_path / "set")
    assert list(tmp_path.iterdir()) == []
    export_demos(short, recorded, tmp_path / "set")


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_task_without_a_minari_format_is_refused(
    short, recorded, exported, tmp_path, monkeypatch
):
    monkeypatch.setattr(type(short), "placed", ())
    with pytest.raises(InputError, match="no Minari format is known for 'door': its class"):
        export_demos(short, recorded, tmp_path / "new")
    assert not (tmp_path / "new").exists()
    with pytest.raises(InputError, match="no Minari format is known for 'door'"):
        import_demos(short, exported)


def test_initial_states_have_the_names_of_the_environments(task):
    names = {
        "tool": {"board_pos"},
        "door": {"door_body_pos"},
        "relocation": {"obj_pos", "target_pos"},
        "reorientation": {"desired_orien"},
    }
    assert {placed.name for placed in task.placed} == names[task.name]
