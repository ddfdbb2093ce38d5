"""Interrupts runs and damages results, at random moments and places; --times sets how often.

In every case the same command resumes, and ends with the files of an undisturbed run.
"""

import errno
import os
import random
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from itertools import permutations

import pytest

from bench.backend import Workers
from bench.driver import run
from bench.presets import get_preset
from bench.results import Results
from bench.run_state import StateFile

COMMAND = [sys.executable, "-c", "from bench.cli import main; main()", "run", "smoke"]
STUDY = ["--tasks", "relocation", "--methods", "kodex,nn", "--experiments", "sizes,success"]


def start(*options, **environment):
    return subprocess.Popen(
        [*COMMAND, *STUDY, *options],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        env=os.environ | environment,
    )


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    out = tmp_path_factory.mktemp("uninterrupted")
    assert start("--out", str(out), "--jobs", "1", OMP_NUM_THREADS="1").wait() == 0
    return out


@pytest.fixture
def same(uninterrupted, files_of):
    """Whether a folder is that of the uninterrupted run."""
    return lambda folder: files_of(folder) == files_of(uninterrupted)


# Backend, jobs and threads; only the full count tries those after the second.
PLACES = (("loky", 2, 2), ("dask", 2, 2), ("loky", 4, 1), ("loky", 1, 2), ("sequential", 1, 2))


def test_jobs_threads_and_backends_do_not_change_results(same, tmp_path, times, figure):
    places = PLACES[: 2 if times == 1 else None]
    for backend, jobs, threads in places:
        out = tmp_path / f"{backend}-{jobs}-{threads}"
        options = ("--out", str(out), "--jobs", str(jobs), "--backend", backend)
        assert start(*options, OMP_NUM_THREADS=str(threads)).wait() == 0
        assert same(out)
    figure("places that make no difference", len(places))


@pytest.mark.parametrize("harm", [signal.SIGKILL, signal.SIGINT])
def test_a_stopped_run_resumes(
    same, uninterrupted, files_of, ends_within, tmp_path, times, harm, figure
):
    draw = random.Random(int(harm))
    whole = files_of(uninterrupted).items()
    out, before, stops, studies = tmp_path / "0", {}, 0, 0
    times = times if harm == signal.SIGKILL else (times + 1) // 2
    while stops < times or studies == 0:
        running = start("--out", str(out), "--jobs", "2")
        try:
            wait = None if stops == times else draw.uniform(2, 12)
            assert running.wait(timeout=wait) == 0
            assert same(out)
            studies += 1
            out, before = tmp_path / str(studies), {}
        except subprocess.TimeoutExpired:
            os.killpg(running.pid, harm)
            figure("seconds to the prompt", seconds_to_end(running))
            assert ends_within(10, running.pid)
            after = files_of(out)
            assert before.items() <= after.items() <= whole
            before, stops = after, stops + 1
    figure("times stopped", stops)
    figure("studies completed", studies)


def seconds_to_end(process):
    began = time.perf_counter()
    process.wait(timeout=30)
    return time.perf_counter() - began


@pytest.fixture
def study(smoke):
    return replace(get_preset("smoke"), tasks=("door",))


@pytest.fixture
def whole(study, tmp_path):
    """A study's results."""
    run(study, tmp_path / "whole", Workers(1, "sequential"))
    return tmp_path / "whole"


@pytest.mark.parametrize("task", ["door"], indirect=True)
@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EIO])
def test_a_failed_write_leaves_no_partial_file(
    task, smoke, bench, whole, files_of, tmp_path, monkeypatch, times, error, figure
):
    # A run goes on without the file of its progress, which it writes whenever there is news.
    monkeypatch.setattr(StateFile, "write", lambda *arguments, **options: None)
    flush = os.fsync
    places = range(10**6) if times > 1 else (0, 3, 8, 12)
    for place in places:
        count = iter(range(10**6))

        def fail(handle, place=place, count=count):
            if next(count) == place:
                raise OSError(error, os.strerror(error))
            flush(handle)

        out = tmp_path / str(place)
        options = ("run", "smoke", "--out", str(out), "--jobs", "1")
        monkeypatch.setattr("os.fsync", fail)
        code, _, said = bench(*options)
        monkeypatch.setattr("os.fsync", flush)
        if code == 0:
            assert place > 12
            break
        assert code == 3
        assert f"bench: [Errno {error}] {os.strerror(error)}" in said
        assert "rerun the same command to resume" in said
        assert set(files_of(out).items()) <= set(files_of(whole).items())
        assert bench(*options)[0] == 0
        assert files_of(out) == files_of(whole)
    figure("writes that failed", place)


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_damaged_results_are_set_aside_and_computed_again(
    task, study, whole, files_of, times, capsys, figure
):
    draw = random.Random(2)
    sound = files_of(whole)
    table = rates(whole)
    for _ in range(5 * times):
        paths = [
            path
            for folder in ("cells", "controllers")
            for path in sorted((whole / folder).rglob("*"))
            if path.is_file()
        ]
        path = draw.choice(paths)
        other = draw.choice([other for other in paths if other != path])
        before = path.read_bytes()
        path.write_bytes(draw.choice((flipped, cut, emptied))(draw, before))
        if draw.random() < 0.25:
            path.write_bytes(other.read_bytes())
        assert rates(whole).items() <= table.items()
        run(study, whole, Workers(1, "sequential"))
        assert files_of(whole) == sound
        assert re.search("set aside as", capsys.readouterr().err)
    figure("damaged files set aside", 5 * times)


def rates(folder):
    """The outcome of each stored evaluation, from which tables are made."""
    frame = Results(folder).frame()
    if frame.empty:
        return {}
    places = zip(frame.folder, frame.split, frame.physics, strict=True)
    return dict(zip(places, zip(frame.successes, frame.episodes, strict=True), strict=True))


def flipped(draw, content):
    place = draw.randrange(len(content))
    return content[:place] + bytes([content[place] ^ 1 << draw.randrange(8)]) + content[place + 1 :]


def cut(draw, content):
    return content[: draw.randrange(len(content))]


def emptied(draw, content):
    return b""


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_the_order_of_experiments_does_not_change_results(
    task, study, whole, files_of, tmp_path, times, figure
):
    experiments = list(study.episodes)
    orders = list(permutations(experiments))
    random.Random(3).shuffle(orders)
    for index, order in enumerate(orders[: 2 * times]):
        out = tmp_path / f"order{index}"
        run(
            replace(study, episodes={n: study.episodes[n] for n in order}),
            out,
            Workers(1, "sequential"),
        )
        assert files_of(out) == files_of(whole)
    figure("orders of experiments", index + 1)
