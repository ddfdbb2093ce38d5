"""The progress that long commands print, and what `bench status` shows of a run."""

import json
import re
import subprocess
import sys
import time

import pytest
from fake_jobs import job

from bench import doing as doing_module
from bench import run_state
from bench.clock import Clock
from bench.doing import doing, hush, say
from bench.job_queue import JobQueue, name_of
from bench.progress import EVERY, Progress
from bench.results_writer import writing
from bench.run_state import NAME, StateFile, read_state
from bench.sealed_files import read_record, seal_record


@pytest.fixture
def writer(tmp_path):
    with writing(tmp_path) as found:
        found.ask_for([])
        yield found


@pytest.fixture
def queue():
    """The jobs of 2 controllers, 400 fits and 400 evaluations, of one second each."""
    counts = {"controllers": 2, "fits": 400, "evaluations": 400}
    return JobQueue(job(f"{kind}{i}", kind=kind) for kind in counts for i in range(counts[kind]))


def progress(writer, queue, now):
    return Progress("results/study", Clock(queue, 1, 0.0), StateFile(writer), now)


class Never:
    """A clock's thread that never ticks."""

    def __init__(self, **_):
        pass

    def start(self):
        pass

    def join(self):
        pass


@pytest.fixture
def no_ticks(monkeypatch):
    monkeypatch.setattr("bench.progress.threading.Thread", Never)


def test_piped_output_has_few_ascii_lines_with_the_time_left(writer, queue, no_ticks, capsys):
    seconds = [0.0]
    with progress(writer, queue, lambda: seconds[0]) as shown:
        shown.begin()
        while one := queue.take():
            shown.start(one)
            seconds[0] += 1
            if seconds[0] % 10 == 0:
                shown._tick_once()
            queue.finish(name_of(one))
            shown.end(one, 1.0)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) <= 1 + 802 / EVERY + 1
    assert all(line.isascii() for line in lines)
    assert "controllers 0/2, fits 0/400, evaluations 0/400" in lines[0]
    assert "about 13 min left (13 min in all)" in lines[0]
    middle = next(line for line in lines if "7 min gone" in line)
    assert "7 min gone, about 6 min left (13 min in all)" in middle
    assert "now: " in lines[-2]
    assert "controllers 2/2, fits 400/400, evaluations 400/400" in lines[-1]


def test_status_shows_the_progress_of_a_run_and_then_that_it_stopped(
    writer, queue, no_ticks, bench
):
    def status(*options):
        return bench("status", str(writer.folder), *options)[1]

    with (  # noqa: PT012
        pytest.raises(KeyboardInterrupt),
        progress(writer, queue, lambda: 0.0) as shown,
    ):
        shown.begin()
        shown.start(queue.take("controllers0"))
        shown._keep()
        said = status()
        assert re.search(r" s gone, about 13 min left \(13 min in all\)", said)
        assert "controllers 0/2, fits 0/400, evaluations 0/400" in said
        assert "now: controllers0 (" in said
        state = json.loads(status("--json"))["run"]
        assert state["running"]
        assert state["kinds"][0] == {"name": "controllers", "done": 0, "of": 2, "failed": 0}
        raise KeyboardInterrupt
    assert "stopped after 0 s; rerun the same command" in status()
    assert not json.loads(status("--json"))["run"]["running"]


def test_a_killed_run_or_one_on_a_silent_host_counts_as_stopped(writer, queue, no_ticks):
    with progress(writer, queue, lambda: 0.0) as shown:
        shown.begin()
        path = writer.folder / NAME
        written = read_record(path)
        assert read_state(writer.folder)["running"]
        ended = subprocess.Popen([sys.executable, "-c", ""])
        ended.wait()
        for change, lives in (
            ({"pid": ended.pid}, False),
            ({"started": written["started"] - 1}, False),  # another process has its number by now
            ({"host": "elsewhere"}, True),
            ({"host": "elsewhere", "written": time.time() - 2 * run_state.SILENCE}, False),
        ):
            path.write_bytes(seal_record(written | change))
            assert read_state(writer.folder)["running"] is lives


def test_an_unreadable_state_counts_as_none(writer, bench):
    path = writer.folder / NAME
    records = ({"pid": "a"}, {"host": 1, "phases": 2, "ended": 1}, {"ended": False})
    for content in (b"", b"{", b"[]", *map(seal_record, records)):
        path.write_bytes(content)
        assert read_state(writer.folder) is None
        assert bench("status", str(writer.folder))[0] == 0


def test_a_state_is_never_half_written(writer, queue, no_ticks, monkeypatch):
    with progress(writer, queue, lambda: 0.0) as shown:
        shown.begin()
        before = (writer.folder / NAME).read_bytes()

        def half(path, content):
            path.write_bytes(content[: len(content) // 2])
            raise OSError("no space left on the device")

        monkeypatch.setattr("bench.sealed_files.flush", half)
        shown.start(queue.take())
        shown._keep()
        assert (writer.folder / NAME).read_bytes() == before


@pytest.mark.parametrize("task", ["door"], indirect=True)
class TestRuns:
    def test_a_complete_run_prints_its_counts_and_removes_its_state(
        self, task, smoke, bench, tmp_path, capsys
    ):
        seen = []
        write = StateFile.write

        def watched(self, state, ended=False):
            write(self, state, ended)
            seen.append(read_state(tmp_path / "results"))

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(StateFile, "write", watched)
            patch.setattr("bench.progress.EVERY", 1e9)
            _, _, said = bench("run", "smoke", "--out", str(tmp_path / "results"), "--jobs", "1")
        assert not (tmp_path / "results" / NAME).exists()
        assert seen[0]["running"]
        first, last = said.splitlines()[0], said.splitlines()[-1]
        assert "controllers 0/1, fits 0/1, evaluations 0/5" in first
        assert "controllers 1/1, fits 1/1, evaluations 5/5" in last
        assert len(said.splitlines()) <= 5

    def test_a_run_without_missing_results_prints_no_progress(self, task, smoke, bench, tmp_path):
        command = ("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
        bench(*command)
        assert bench(*command)[2] == ""

    def test_status_counts_controllers(self, task, smoke, bench, tmp_path):
        bench("run", "smoke", "--out", str(tmp_path), "--jobs", "1")
        assert "controllers: 1 of 1 done" in bench("status", str(tmp_path))[1]
        next(tmp_path.glob("controllers/*/controller.json")).unlink()
        assert "controllers: 0 of 1 done" in bench("status", str(tmp_path))[1]

    def test_long_commands_print_what_they_are_doing(
        self, task, smoke, bench, tmp_path, monkeypatch, capsys
    ):
        monkeypatch.setattr(doing_module, "MOMENT", 0.0)
        monkeypatch.setattr(doing_module, "EVERY", 0.0)
        out = str(tmp_path / "results")
        for command, said in (
            (("plan", "smoke", "--out", out, "--json"), "measuring how fast this machine is"),
            (("run", "smoke", "--out", out, "--jobs", "1"), "looking for missing results"),
            (("demos", "make", "door"), "recording the expert's demonstrations of door"),
            (("time", out), "timing the fit of door-kodex"),
            (("verify", out, "--cells", "1", "--jobs", "1", "--json"), "reading results"),
            (("report", out), "writing "),
            (("compare", out, "--methods", "kodex,expert", "--json"), "on door, test"),
        ):
            _, stdout, stderr = bench(*command)
            assert f"bench: {said}" in stderr or said in stderr, command
            assert "bench: " not in stdout
            if "--json" in command:
                json.loads(stdout)


@pytest.mark.parametrize("task", ["door"], indirect=True)
@pytest.mark.parametrize("command", ["run", "plan"])
@pytest.mark.parametrize(
    "wrong", [("--set", "kodex.epoch=3"), ("--sizes", "huge"), ("--methods", "mine")], ids=" ".join
)
def test_bad_options_are_refused_before_results_are_read(
    task, smoke, bench, tmp_path, monkeypatch, command, wrong
):
    monkeypatch.setattr(doing_module, "MOMENT", 0.0)
    monkeypatch.setattr(doing_module, "EVERY", 0.0)
    code, _, error = bench(command, "smoke", "--out", str(tmp_path / "new"), *wrong)
    assert (code, "unknown " in error, "missing" in error) == (2, True, False)


def test_short_commands_print_no_progress(capsys, monkeypatch):
    monkeypatch.setattr(doing_module, "MOMENT", 60.0)
    with doing("blinking"):
        say("blinking again")
    assert capsys.readouterr().err == ""


def test_long_commands_print_each_step_once(capsys, monkeypatch):
    monkeypatch.setattr(doing_module, "MOMENT", 0.0)
    monkeypatch.setattr(doing_module, "EVERY", 0.0)
    with doing("thinking"):
        say("thinking")
        say("writing")
        hush()
        say("nothing")
    say("nothing")
    assert capsys.readouterr().err.splitlines() == ["bench: thinking", "bench: writing"]


def test_steps_in_quick_succession_are_not_all_printed(capsys, monkeypatch):
    monkeypatch.setattr(doing_module, "MOMENT", 0.0)
    with doing("step 0"):
        for step in range(1000):
            say(f"step {step}")
    assert len(capsys.readouterr().err.splitlines()) <= 2
