"""Demonstrations of a user: recorded from a policy, or made from arrays."""

import os
import re
import sys

import numpy as np
import pytest

import bench as suite
from bench.isolation import Failure
from bench.results import Results
from bench.studies import study_of
from tasks.arrays import Replay
from tasks.demos import load_demos
from tasks.demos_files import save_demos
from tasks.errors import InputError
from tasks.files import from_bytes
from tasks.recorder import record
from tasks.registry import get_task

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)

POLICY = """
import numpy as np
from neighbour import SCALE


def act(state, t):
    return SCALE * np.ones((len(state), {width})) * t


class Steady:
    def reset(self, starts):
        self.actions = np.tile(0.1 * starts[:, :1], {width})

    def act(self, state, t):
        return self.actions


made = Steady()
number = 3


def missing(state, t):
    return {{}}["x"]


def narrow(state, t):
    return np.zeros((len(state), 3))


def gone(state, t):
    return np.full((len(state), {width}), np.nan if t == 2 else 0.0)


def texts(state, t):
    return ["forward"] * len(state)


def dies(state, t):
    import os
    os._exit(7)
"""


@pytest.fixture
def policy(task, tmp_path, monkeypatch):
    """A file of policies in the current folder, and a second file that it imports."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    with open("my_policy.py", "w") as file:
        file.write(POLICY.format(width=task.layout.action_dim))
    with open("neighbour.py", "w") as file:
        file.write("SCALE = 0.2\n")


@pytest.fixture
def here(shipped, monkeypatch):
    """Runs jobs in this process, where the patches of a test apply."""

    def call(job, *arguments):
        found = job(*arguments)
        if isinstance(found, Failure):
            raise InputError(found.reason)
        return found

    monkeypatch.setattr("bench.recording.apart", call)
    monkeypatch.setattr(sys, "path", [*sys.path])


@pytest.mark.parametrize("name", ["act", "Steady", "made"])
def test_successes_of_a_policy_are_recorded(task, policy, here, bench, name):
    words = ("record", "door", "--policy", f"my_policy.py:{name}", "--out", "../mine.safetensors")
    code, out, error = bench("demos", *words, "--count", "5")
    assert code == 0, error
    assert f"door: my_policy.py:{name} succeeds from 6 of 10 starts" in out
    assert "wrote 5 demonstrations to ../mine.safetensors" in out
    assert "10 starts tried, 6 successes found, 5 wanted" in error
    with open("../mine.safetensors", "rb") as file:
        found = from_bytes(file.read())
    assert found["start_index"].tolist() == [1, 2, 4, 6, 7]
    expected = {
        "act": 0.2 * np.arange(5)[:, None] * np.ones(task.layout.action_dim),
        "Steady": 0.1 * found["states"][0, 0, 0],
    }
    np.testing.assert_array_equal(
        found["actions"][0], np.broadcast_to(expected.get(name, expected["Steady"]), (5, 28))
    )


def test_a_study_learns_from_recorded_demonstrations(task, policy, smoke, here, bench, tmp_path):
    record = ("record", "door", "--policy", "my_policy.py:act", "--out", "mine.safetensors")
    assert bench("demos", *record, "--count", "5")[0] == 0
    run = ("run", "smoke", "--jobs", "1", "--episodes", "2", "--out", "results")
    code, _, error = bench(*run, "--demos", "mine.safetensors")
    assert code == 0, error
    assert "not the demonstrator" in Results(tmp_path / "here" / "results").notes()[0]


@pytest.mark.parametrize(
    ("place", "answer"),
    [
        ("my_policy.py:missing", "KeyError: 'x' (my_policy.py:23 in missing)"),
        ("my_policy.py:narrow", "my_policy.py:narrow returns at t = 0 must have shape (B, A) = (5"),
        ("my_policy.py:gone", "my_policy.py:gone returns at t = 2 must be finite"),
        ("my_policy.py:texts", "my_policy.py:texts returns at t = 0 must hold real numbers"),
        ("my_policy.py:dies", "its process ended with exit code 7"),
        ("my_policy.py:number", "my_policy.py:number is a int: a policy is a function act(state"),
        ("my_policy.py:att", "did you mean 'act'"),
        ("my_policy.py", "--policy takes FILE.py:NAME or MODULE:NAME"),
        ("policy.py:act", "the file policy.py does not exist"),
        ("no_such_module:act", "no_such_module cannot be imported: ModuleNotFoundError"),
    ],
)
def test_an_unusable_policy_is_named_and_nothing_is_written(
    task, policy, bench, tmp_path, place, answer
):
    """The policy runs in a separate process, as for a user."""
    code, out, error = bench("demos", "record", "door", "--policy", place, "--out", "../a/mine")
    assert (code, out) == (2, "")
    assert answer in error
    assert not (tmp_path / "a").exists()


def test_a_policy_that_seldom_succeeds_is_refused(task, policy, here, bench, monkeypatch, tmp_path):
    monkeypatch.setattr(type(task), "success", lambda self, r: np.zeros(len(r), bool))
    code, _, error = bench(
        "demos", "record", "door", "--policy", "my_policy.py:act", "--out", "mine"
    )
    assert code == 2
    assert "my_policy.py:act succeeded in 0 of 5 episodes of door, fewer than one in ten" in error
    assert not os.path.exists("mine")


@pytest.fixture
def arrays(task, shipped):
    """Recorded episodes as arrays; every third fails on replay."""
    made = load_demos(task)
    return {"actions": made.actions, "starts": made.starts.values, "states": made.states}


def test_from_arrays_keeps_the_episodes_that_succeed_on_replay(task, arrays, bench, tmp_path):
    np.savez(tmp_path / "mine.npz", velocities=np.zeros(3), **arrays)
    out = tmp_path / "mine.safetensors"
    code, said, error = bench(
        "demos", "from-arrays", "door", str(tmp_path / "mine.npz"), "--out", str(out)
    )
    assert code == 0
    assert "mine.npz: not read: velocities; arrays read are actions, starts, states" in error
    assert "door: 5 of 8 episodes successful on replay\nepisodes that fail: 0, 3, 6" in said
    assert "the given states differ from the replay by at most 0" in said
    kept = [1, 2, 4, 5, 7]
    np.testing.assert_array_equal(from_bytes(out.read_bytes())["states"], arrays["states"][kept])
    training, validation = suite.demos("door", out)
    assert (len(training), len(validation)) == (3, 2)
    shuffled = np.concatenate([training.states, validation.states])
    assert sorted(shuffled.tolist()) == sorted(arrays["states"][kept].tolist())

    found = suite.demos_from_arrays("door", **arrays)
    assert found.success.tolist() == [row in kept for row in range(8)]
    found.save(tmp_path / "again.safetensors")
    assert (tmp_path / "again.safetensors").read_bytes() == out.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        found.save(out)


def test_from_arrays_measures_how_far_given_states_differ(task, arrays):
    found = suite.demos_from_arrays("door", **arrays | {"states": arrays["states"] + 0.25})
    assert found.drift == pytest.approx(0.25)
    del arrays["states"]
    assert suite.demos_from_arrays("door", **arrays).drift is None


def test_actions_are_applied_and_stored_clipped(task, arrays):
    found = suite.demos_from_arrays(
        "door", actions=np.sign(arrays["actions"]) * 7, starts=arrays["starts"]
    )
    assert set(np.unique(found.demos.actions)) == {-1.0, 1.0}


@pytest.mark.parametrize(
    ("name", "change", "answer"),
    [
        ("actions", lambda a: a[:, :-1], r"must have shape \(N, T-1, A\) = \(N, 5, 28\), got \(8"),
        ("actions", lambda a: a[0], r"must have shape \(N, T-1, A\)"),
        ("actions", lambda a: a.astype(complex), "actions of door must hold real numbers"),
        ("actions", lambda a: np.where(a == a[3, 2, 1], np.nan, a), "those of episode 3 are not"),
        ("starts", lambda a: a[:, :2], r"must have shape \(N, P\) = \(N, 3\), got \(8, 2\)"),
        ("starts", lambda a: a[:-1], "same number of episodes, got 8 of actions, 7 of sta"),
        ("starts", lambda a: a + 100, "allowed is"),
        ("states", lambda a: a[..., 1:], r"\(N, T, D\)"),
        ("starts", lambda a: a[:0], "starts of door holds no episodes"),
    ],
)
def test_arrays_of_other_shapes_or_values_are_refused(task, arrays, name, change, answer):
    with pytest.raises(InputError, match=answer):
        suite.demos_from_arrays("door", **arrays | {name: change(arrays[name])})


class Evil:
    def __reduce__(self):
        return os.mkdir, ("executed",)


@pytest.mark.parametrize(
    ("harm", "answer"),
    [
        ("pickled", "cannot be read as an .npz file of numbers"),
        ("npy", "is not an .npz file"),
        ("text", "is not an .npz file"),
        ("cut", "is not an .npz file"),
        ("nothing", "does not exist: name an .npz file"),
        ("lacks", "lacks starts: .* it holds actions"),
    ],
)
def test_a_file_that_holds_no_arrays_is_refused(
    task, arrays, bench, tmp_path, monkeypatch, harm, answer
):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "mine.npz"
    if harm == "pickled":
        np.savez(file, actions=np.array([Evil()], object), starts=arrays["starts"])
    elif harm == "lacks":
        np.savez(file, actions=arrays["actions"])
    elif harm == "npy":
        with file.open("wb") as opened:
            np.save(opened, arrays["actions"])
    elif harm == "cut":
        np.savez(file, **arrays)
        file.write_bytes(file.read_bytes()[:-400])
    elif harm == "text":
        file.write_text("actions")
    code, _, error = bench("demos", "from-arrays", "door", "mine.npz", "--out", "out")
    assert code == 2
    assert re.search(answer, error)
    assert not (tmp_path / "executed").exists()
    assert not (tmp_path / "out").exists()


def test_a_file_with_another_ending_is_refused(task, arrays, bench, tmp_path):
    np.savez(tmp_path / "mine.npz", **arrays)
    file = (tmp_path / "mine.npz").rename(tmp_path / "mine.zip")
    code, _, error = bench("demos", "from-arrays", "door", str(file), "--out", str(tmp_path / "a"))
    assert (code, "mine.zip must end in .npz" in error) == (2, True)


def test_every_writing_command_accepts_relative_paths(task, policy, here, arrays, bench, tmp_path):
    np.savez("mine.npz", **arrays)
    for words in (
        ("export", "door", "../set"),
        ("import", "door", "../set", "--out", "../a/imported"),
        ("from-arrays", "door", "mine.npz", "--out", "../b/arrays"),
        ("record", "door", "--policy", "my_policy.py:act", "--count", "5", "--out", "c/recorded"),
        ("export", "door", "d/set"),
    ):
        code, out, error = bench("demos", *words)
        assert code == 0, error
        assert f"to {words[-1]}" in out
    for file in ("../a/imported", "../b/arrays", "c/recorded"):
        assert sum(map(len, suite.demos("door", file))) == 5


def test_a_run_of_several_tasks_takes_one_file_for_each_task(task, smoke, bench, tmp_path):
    tool = get_task("tool")
    files = [tmp_path / name for name in ("door.safetensors", "tool.safetensors")]
    save_demos(load_demos(task)[:5], files[0])
    actions = np.zeros((4, tool.steps, tool.layout.action_dim))
    starts = tool.sample("demo", 4)
    save_demos(record(tool, starts, Replay(actions), failures=True)[1], files[1])
    study = study_of("quick", tasks="door,tool", demos=files)
    assert set(study.demos_keys) == {"door", "tool"}
    assert study.demos <= 3
    assert all(name in study.note for name in ("door.safetensors", "tool.safetensors"))
