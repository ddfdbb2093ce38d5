"""Commands that read results change nothing in the folder and name damaged files."""

import json
import os
import re
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

import bench as suite
from bench.results import REPORTED
from bench.results_writer import writing
from bench.stored_files import Times

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)

RUN = ("run", "smoke", "--methods", "kodex,nn", "--seeds", "3", "--episodes", "3")
RUN += ("--set", "nn.epochs=1", "--jobs", "1", "--out")


def flip(content):
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


def cut(content):
    return content[:-7]


# A damaged file, how it is damaged, and what is set aside because of it.
EPISODES = (
    "cells/door-kodex-*-s1-*/eval-ood-*",
    flip,
    "eval-ood-nominal-original-appendix.parquet",
)
WEIGHTS = ("cells/door-nn-*-s1-*/weights.safetensors", cut, "door-nn-\\S*-s1-")
TIMES = ("cells/door-kodex-*-s1-*/times.json", flip, "times.json")
FAILURE = ("failures/*.json", cut, "failures/")
CONTROLLER = ("controllers/*-s1-*/controller.json", flip, "door-original-nominal-s1-")
DAMAGES = (EPISODES, WEIGHTS, TIMES, FAILURE, CONTROLLER)


@pytest.fixture
def folder(task, smoke, bench, tmp_path):
    """Results of KODex and NN with three seeds; one damaged leaves two to compare."""
    out = tmp_path / "results"
    assert bench(*RUN, str(out))[0] == 0
    with writing(out) as writer:
        rows = writer.results.frame().query("method == 'kodex' and seed == 1")
        writer.add_times(rows.folder.iloc[0], Times([1.0]))
        writer.add_failure("a method", "reason", "traceback")
    return out


@dataclass(frozen=True)
class Reader:
    """Reads a folder without write permission, and checks that it stays unchanged."""

    folder: Path
    bench: Callable
    capsys: pytest.CaptureFixture

    def damage(self, *damages):
        for pattern, harm, _ in damages:
            (path,) = self.folder.glob(pattern)
            path.write_bytes(harm(path.read_bytes()))

    def command(self, *words, code=0, names=()):
        """Returns the output of a command; stderr must name each damaged file once."""
        with self._unchanged():
            found, said, errors = self.bench(*words)
        assert found == code, errors
        self._check(names, errors)
        return said

    def call(self, function, names=()):
        """Returns what a function returns, see `command`."""
        with self._unchanged():
            found = function()
        self._check(names, self.capsys.readouterr().err)
        return found

    @contextmanager
    def _unchanged(self):
        REPORTED.clear()  # as in a process of its own
        before = files(self.folder)
        permit(self.folder, 0o555, 0o444)  # root may write all the same
        yield
        permit(self.folder, 0o755, 0o644)
        assert files(self.folder) == before

    @staticmethod
    def _check(names, errors):
        for _, _, name in names:
            line = rf"^\S*{name}\S* is damaged \(.*\); the next `bench run` sets it aside$"
            assert len(re.findall(line, errors, re.M)) == 1, errors


@pytest.fixture
def read(bench, folder, capsys):
    return Reader(folder, bench, capsys)


def permit(folder, folders, others):
    for path in (folder, *folder.rglob("*")):
        path.chmod(folders if path.is_dir() else others)


def files(folder):
    """Values that change when a file or folder is written, moved or replaced."""
    return {
        str(path): (found.st_ino, found.st_size, found.st_mtime_ns)
        for path in (folder, *folder.rglob("*"))
        for found in [os.lstat(path)]
    }


def test_commands_read_damaged_results_without_changing_them(
    task, folder, bench, read, tmp_path, files_of
):
    sound, out = files_of(folder), str(tmp_path / "out")
    read.damage(EPISODES, WEIGHTS, TIMES, FAILURE)
    place, rows = str(folder), (EPISODES, WEIGHTS, TIMES)
    read.command("report", place, "--out", out, names=rows)
    plan = json.loads(read.command("plan", *RUN[1:], place, "--json", names=(EPISODES, WEIGHTS)))
    assert (plan["missing_fits"], plan["missing_evaluations"]) == (1, 4)
    status = json.loads(read.command("status", place, "--json", names=(EPISODES, WEIGHTS, FAILURE)))
    assert (status["fits_done"], status["fits"]) == (5, 6)
    assert (status["evaluations_done"], status["evaluations"]) == (14, 18)
    assert status["failures"] == []
    read.command("compare", place, "--methods", "kodex,nn", names=rows)
    read.command("verify", place, "--cells", "2", "--jobs", "1", names=rows)
    read.command("merge", place, "--out", str(tmp_path / "merged"), names=rows)
    read.command("pack", place, "--out", str(tmp_path / "packed"), names=rows)
    read.command("failures", place, "--method", "kodex", "--out", out, names=rows)
    assert len(read.call(lambda: suite.load(folder), names=rows)) == (2 + 3) + 4 * (2 + 3 + 3)
    opened = suite.open(folder)
    assert len(read.call(lambda: opened.frame, names=rows)) == 14
    assert set(read.call(lambda: list(opened.methods("door", seed=2)))) == {"kodex", "nn"}
    assert len(read.call(lambda: opened.failures("door", "kodex"))) > 0
    said = bench(*RUN, place)[2]
    assert said.count("set aside as") == 4
    assert files_of(folder) == sound


@pytest.mark.skipif(not os.environ["MUJOCO_GL"], reason="MuJoCo cannot draw on this machine")
def test_video_leaves_damaged_results_unchanged(task, folder, read, tmp_path):
    read.damage(EPISODES, WEIGHTS)
    options = ("--methods", "kodex", "--start", "1", "--out", str(tmp_path / "films"))
    read.command("video", "door", "--results", str(folder), *options, names=(EPISODES, WEIGHTS))


def test_a_damaged_controller_is_named_and_left_until_the_next_run(
    task, folder, bench, read, files_of, tmp_path
):
    sound, place = files_of(folder), str(folder)
    read.damage(CONTROLLER)
    assert "missing: 0 controllers" in read.command("plan", *RUN[1:], place, names=[CONTROLLER])
    assert "controllers: 2 of 3 done" in read.command("status", place, names=[CONTROLLER])
    read.command("verify", place, "--cells", "18", "--jobs", "1", code=2, names=[CONTROLLER])
    read.command("merge", place, "--out", str(tmp_path / "merged"), names=[CONTROLLER])
    read.command("report", place, "--out", str(tmp_path / "out"), code=3, names=[CONTROLLER])
    assert "set aside as" in bench(*RUN, place)[2]
    assert files_of(folder) == sound
