import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save

from tasks import demos, experts
from tasks.cache import cache_folder
from tasks.data import Demos, UnclippedDemos, key
from tasks.demos_files import save_demos, task_of
from tasks.errors import InputError
from tasks.recorder import Recorder, make_demos, record
from tasks.registry import get_task
from tasks.simulator import Simulator, rollout

TRAINING, VALIDATION = 6, 2


def test_an_expert_applies_tanh_layers_to_normalised_inputs(task, shipped):
    simulator = Simulator(task, task.sample("probe", 3))
    actions = experts.load_expert(task).policy.act(simulator, 0)
    for row, seen in enumerate(experts.expert_input(simulator)):
        normal = [
            (x - m) / s for x, m, s in zip(seen, shipped["mean"], shipped["std"], strict=True)
        ]
        hidden = np.tanh(shipped["weight0"] @ np.clip(normal, -10, 10) + shipped["bias0"])
        np.testing.assert_allclose(
            actions[row], shipped["weight1"] @ hidden + shipped["bias1"], rtol=0, atol=1e-12
        )


def test_weights_that_no_longer_match_their_card_are_refused(task, shipped, tmp_path):
    experts.load_expert(task)
    path = tmp_path / "experts" / "first" / f"{task.name}.safetensors"
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    with pytest.raises(InputError, match="but its card says"):
        experts.load_expert(task)
    card = path.with_suffix(".json")
    for content in (b'{"task": ', b"{}", b"\xff", b"[]"):
        card.write_bytes(content)
        with pytest.raises(InputError, match=r"first expert of \w+ cannot be read .*: reinstall"):
            experts.load_expert(task)
    path.unlink()
    with pytest.raises(InputError, match=r"first expert of \w+ cannot be read .*: reinstall"):
        experts.load_expert(task)


def test_a_task_without_an_expert_says_how_to_give_demonstrations(task, tmp_path, monkeypatch):
    monkeypatch.setattr(experts, "SHIPPED", tmp_path)
    with pytest.raises(InputError, match=f"'{task.name}' has no expert: .*bench demos record"):
        experts.load_expert(task)


def test_demonstrations_are_the_first_successes_of_the_expert(task, shipped):
    made = demos.load_demos(task)
    assert len(made) == TRAINING + VALIDATION
    # every third of a block of five fails
    assert made.starts.index.tolist() == [1, 2, 4, 6, 7, 9, 11, 12]
    assert made.states.shape == (8, 6, task.layout.state_dim)
    assert made.velocities.shape == (8, 6, task.robot_dim)
    assert made.actions.shape == (8, 5, task.layout.action_dim)
    assert np.abs(made.actions).max() <= 1


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_each_seed_has_a_file_of_demonstrations_from_its_own_starts(task, shipped):
    one, two = demos.load_demos(task, 1), demos.load_demos(task, 2)
    assert (one.starts.seed, two.starts.seed) == (1, 2)
    for made in (one, two):
        tried = task.sample("demo", 15, made.starts.seed)
        np.testing.assert_array_equal(made.starts.values, tried.values[made.starts.index])
    assert not np.isin(one.starts.values, two.starts.values).any()
    assert demos.demos_path(task, 1) != demos.demos_path(task, 2)
    data = demos.demos_path(task, 2).read_bytes()
    demos.demos_path(task, 2).unlink()
    demos.load_demos(task, 2)
    assert demos.demos_path(task, 2).read_bytes() == data


def test_raw_actions_equal_the_recorded_ones_after_clipping(task, shipped):
    starts, expert = task.sample("demo", 5), experts.load_expert(task).policy
    (_, clipped), (_, raw) = (record(task, starts, expert, raw=raw) for raw in (False, True))
    np.testing.assert_array_equal(np.clip(raw.actions, -1, 1), clipped.actions)
    np.testing.assert_array_equal(raw.states, clipped.states)
    assert np.abs(raw.actions).max() > 1
    assert (type(raw), type(clipped)) == (UnclippedDemos, Demos)


def test_replaying_recorded_actions_gives_the_recorded_states(task, shipped):
    made = demos.load_demos(task)
    simulator = Simulator(task, made.starts)
    for step in range(task.horizon - 1):
        np.testing.assert_array_equal(simulator.state(), made.states[:, step])
        hand = simulator.batch.qvel[:, : task.robot_dim]
        np.testing.assert_array_equal(hand, made.velocities[:, step])
        simulator.step(made.actions[:, step])
    np.testing.assert_array_equal(simulator.state(), made.states[:, -1])


def test_cached_demonstrations_are_reused_and_reproducible(task, shipped):
    first = demos.load_demos(task)
    path = demos.demos_path(task)
    data = path.read_bytes()
    made = path.stat().st_mtime_ns
    again = demos.load_demos(task)
    assert path.stat().st_mtime_ns == made
    np.testing.assert_array_equal(first.states, again.states)
    path.unlink()
    demos.load_demos(task)
    assert path.read_bytes() == data
    part = make_demos(task, experts.load_expert(task).policy, 3, seed=1, threads=1)
    np.testing.assert_array_equal(part.states, first[:3].states)


@pytest.mark.parametrize("position", [0, 100, -1])
def test_demonstrations_with_a_flipped_byte_are_made_again(task, shipped, position, capsys):
    demos.load_demos(task)
    path = demos.demos_path(task)
    sound = path.read_bytes()
    damaged = bytearray(sound)
    damaged[position] ^= 0x10
    path.write_bytes(damaged)
    demos.load_demos(task)
    assert path.read_bytes() == sound
    assert "damaged" in capsys.readouterr().err


def test_demonstrations_with_a_damaged_digest_are_made_again(task, shipped, capsys):
    demos.load_demos(task)
    path = demos.demos_path(task)
    digest = path.with_name(f"{path.name}.sha256")
    sound = digest.read_bytes()
    digest.write_bytes(bytes([sound[0] ^ 0x80]) + sound[1:])
    demos.load_demos(task)
    assert digest.read_bytes() == sound
    assert "made anew" in capsys.readouterr().err


def test_demonstrations_without_their_digest_are_made_again(task, shipped, capsys):
    demos.load_demos(task)
    path = demos.demos_path(task)
    data = path.read_bytes()
    path.with_name(f"{path.name}.sha256").rename(path.with_suffix(".sha256"))
    demos.load_demos(task)
    assert path.read_bytes() == data
    assert "lacks its SHA-256" in capsys.readouterr().err


def test_files_that_differ_only_in_their_suffix_are_both_read(task, shipped, tmp_path):
    made = demos.load_demos(task)
    files = [tmp_path / name for name in ("mine.human", "mine.cloned")]
    save_demos(made[:5], files[0])
    save_demos(made, files[1])
    found = [demos.load_adopted(task, demos.adopt_demos(task, file)) for file in files]
    assert list(map(len, found)) == [5, 8]


def write_file(path, made, **changes):
    """Writes a file like `save_demos`, with some arrays changed and the right SHA-256."""
    arrays = {
        "states": made.states,
        "velocities": made.velocities,
        "actions": made.actions,
        "start_index": made.starts.index,
        "start_values": made.starts.values,
    }
    data = save({name: array for name, array in (arrays | changes).items() if array is not None})
    path.write_bytes(data)
    path.with_name(f"{path.name}.sha256").write_text(hashlib.sha256(data).hexdigest())
    return data


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_file_in_single_precision_is_converted_to_double(task, shipped, tmp_path):
    made = demos.load_demos(task)
    write_file(tmp_path / "mine", made, states=made.states.astype(np.float32))
    recipe = demos.adopt_demos(task, tmp_path / "mine")
    found = demos.load_adopted(task, recipe)
    assert found.states.dtype == np.float64
    np.testing.assert_array_equal(found.states, made.states.astype(np.float32))
    assert demos.adopt_demos(task, tmp_path / "mine") == recipe


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_the_key_of_a_file_depends_only_on_its_arrays(task, shipped, tmp_path):
    """The label with the task's name is optional."""
    made = demos.load_demos(task)
    save_demos(made, tmp_path / "mine")
    write_file(tmp_path / "nameless", made)
    digest = hashlib.sha256((tmp_path / "nameless").read_bytes()).hexdigest()
    assert task_of(tmp_path / "mine") == "door"
    assert task_of(tmp_path / "nameless") == ""
    for name in ("mine", "nameless"):
        assert demos.adopt_demos(task, tmp_path / name) == key("demos file", digest)


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_file_of_another_task_is_refused(task, shipped, tmp_path):
    save_demos(demos.load_demos(task), tmp_path / "mine")
    with pytest.raises(InputError, match=r"mine holds demonstrations of door, not of relocation"):
        demos.read_demos(get_task("relocation"), tmp_path / "mine")


@pytest.mark.parametrize("task", ["door"], indirect=True)
@pytest.mark.parametrize(
    ("name", "change", "answer"),
    [
        ("states", lambda a: a.astype(np.complex64), "states of demonstrations must hold real"),
        ("states", lambda a: np.where(a == a, np.nan, a), "must be finite, got nan"),
        ("actions", lambda a: 50 * np.ones_like(a), r"must lie in \[-1, 1\], got 50"),
        ("start_index", lambda a: a + 0.5, "must be whole numbers from 0"),
        ("start_values", lambda a: a + 100, "allowed is"),
        ("velocities", lambda a: a[:, :-1], "got shapes"),
        ("states", lambda a: a[..., :-1], "in each demonstration, got"),
        ("actions", lambda a: None, "does not hold demonstrations: it lacks actions; such a file"),
    ],
)
def test_invalid_contents_of_a_file_are_refused_with_its_name(
    task, shipped, tmp_path, name, change, answer
):
    made = demos.load_demos(task)
    starts = {"start_index": made.starts.index, "start_values": made.starts.values}
    array = starts[name] if name in starts else getattr(made, name)
    write_file(tmp_path / "mine.safetensors", made, **{name: change(array)})
    with pytest.raises(InputError, match=answer) as refused:
        demos.adopt_demos(task, tmp_path / "mine.safetensors")
    assert str(refused.value).startswith(str(tmp_path / "mine.safetensors"))


def refuse(*arguments, **options):
    raise PermissionError(13, "Permission denied")


@pytest.mark.parametrize("task", ["door"], indirect=True)
@pytest.mark.parametrize("harm", ["cache is a file", "folder is a file", "no permission", "/proc"])
def test_an_unwritable_cache_is_reported_before_demonstrations_are_made(
    task, shipped, tmp_path, monkeypatch, harm
):
    cache = tmp_path / "cache"
    if harm == "cache is a file":
        cache.touch()
    elif harm == "folder is a file":
        cache.mkdir()
        (cache / "demos").touch()
    elif harm == "/proc":
        monkeypatch.setenv("BENCH_CACHE", "/proc/cache")
        cache = "/proc/cache"
    else:
        monkeypatch.setattr("tasks.files.TemporaryFile", refuse)
    monkeypatch.setattr(demos, "make_demos", pytest.fail)
    with pytest.raises(InputError, match=rf"{cache}/demos'? cannot be .* set BENCH_CACHE"):
        demos.load_demos(task)


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_read_only_cache_can_be_read(task, shipped, monkeypatch):
    made = demos.load_demos(task)
    monkeypatch.setattr("tasks.files.TemporaryFile", refuse)
    np.testing.assert_array_equal(demos.load_demos(task).states, made.states)


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_an_unreadable_file_in_the_cache_is_named(task, shipped):
    demos.demos_path(task).mkdir(parents=True)
    with pytest.raises(InputError, match=rf"{demos.demos_path(task)} cannot be read"):
        demos.load_demos(task)


def test_a_user_without_a_home_folder_is_told_to_set_bench_cache(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    for name in ("BENCH_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    with pytest.raises(InputError, match=r"no home folder .* BENCH_CACHE"):
        cache_folder()


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_failed_write_of_demonstrations_leaves_nothing(task, shipped, tmp_path, monkeypatch):
    made = demos.load_demos(task)
    monkeypatch.setattr("tasks.files.os.fsync", refuse)
    with pytest.raises(PermissionError):
        save_demos(made, tmp_path / "new" / "mine")
    assert not (tmp_path / "new").exists()


def test_an_expert_that_always_fails_is_refused(task, shipped, monkeypatch):
    monkeypatch.setattr(type(task), "success", lambda self, r: np.zeros(len(r), bool))
    with pytest.raises(InputError, match=r"succeeded in 0 of \d+ episodes"):
        make_demos(task, experts.load_expert(task).policy, 2)


def test_other_weights_of_the_expert_give_other_demonstrations(task, shipped, tmp_path):
    before = demos.demos_path(task)
    data = save({name: 2 * values for name, values in shipped.items()})
    (tmp_path / "experts" / "first" / f"{task.name}.safetensors").write_bytes(data)
    card = {"weights_sha256": hashlib.sha256(data).hexdigest()}
    (tmp_path / "experts" / "first" / f"{task.name}.json").write_text(json.dumps(card))
    assert demos.demos_path(task) != before


def test_demonstrations_with_mismatched_shapes_are_refused(task):
    starts = task.sample("demo", 2)
    states, velocities = np.zeros((2, 4, 9)), np.zeros((2, 4, 5))
    Demos(starts, states, velocities, np.zeros((2, 3, 5)))
    for actions in (np.zeros((2, 4, 5)), np.zeros((2, 3)), np.zeros((1, 3, 5))):
        with pytest.raises(InputError, match=r"\(B, T-1, A\), got shapes"):
            Demos(starts, states, velocities, actions)
    with pytest.raises(InputError, match="2 demonstrations have 1 starts"):
        Demos(starts[:1], states, velocities, np.zeros((2, 3, 5)))
    states[1, 2] = np.nan
    with pytest.raises(InputError, match="states of demonstration 1 must be finite"):
        Demos(starts, states, velocities, np.zeros((2, 3, 5)))


def test_recording_does_not_change_the_rollout(task, shipped):
    policy = experts.load_expert(task).policy
    starts = task.sample("demo", 4)
    plain = rollout(task, starts, policy)
    recorded = rollout(task, starts, Recorder(policy))
    np.testing.assert_array_equal(plain.readings, recorded.readings)
