"""Jobs that fail, hang, or whose worker dies, on each backend."""

import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from functools import partial

import distributed  # noqa: F401, whose defaults dask's configuration must have
import numpy as np
import psutil
import pytest
from dask import config as dask_config

from bench.backend import TRIES, Failure, Interrupts, Workers, answers, workers
from tasks.errors import InputError

BACKENDS = ("loky", "dask")


def outcome(jobs, where):
    """What each job gave, in their order; no job may give two answers."""
    found = {}
    with workers(where), Interrupts() as interrupts:
        for index, answer in answers([partial(tuple, job) for job in jobs], where, interrupts):
            assert index not in found
            found[index] = answer.result
    return [found[index] for index in range(len(jobs))]


@pytest.mark.parametrize("backend", ["sequential", *BACKENDS])
def test_a_job_that_raises_leaves_its_reason_and_the_rest_goes_on(backend):
    jobs = [(math.sqrt, (value,)) for value in (4.0, -1.0, 9.0)]
    first, failure, last = outcome(jobs, Workers(2, backend))
    assert (first, last) == (2.0, 3.0)
    assert failure.reason.startswith("ValueError: ")
    assert "math" in failure.reason
    assert failure.tries == 1


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.filterwarnings("ignore")  # of the worker that is no more
def test_a_job_that_kills_its_worker_is_tried_alone_and_then_blamed(backend):
    jobs = [(math.sqrt, (4.0,)), (os.abort, ()), *[(math.sqrt, (9.0,))] * 5]
    first, failure, *rest = outcome(jobs, Workers(2, backend))
    assert [first, *rest] == [2.0, *[3.0] * 5]
    assert isinstance(failure, Failure)
    assert failure.tries == TRIES
    assert failure.reason.startswith(f"its worker died {TRIES} times")


def test_clusters_of_two_runs_do_not_meet():
    with workers(Workers(1, "dask")):
        assert outcome([(math.sqrt, (4.0,))], Workers(1, "dask")) == [2.0]


BUSY = """
import os, pathlib, time
sign = pathlib.Path({folder!r}, str(os.getpid()))
sign.touch()
time.sleep(0.5)
sign.unlink()
"""


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.filterwarnings("ignore")
def test_innocent_jobs_survive_the_death_of_workers(backend, times, tmp_path, figure):
    """Workers are killed while two are busy: a job that is tried again alone is spared."""
    draw, over, deaths = np.random.default_rng(0), threading.Event(), []

    def kill():
        while len(deaths) < 2 + times and not over.wait(draw.uniform(0.1, 1)):
            # Loky ends the other workers too, whose signs stay behind.
            busy = [sign for sign in tmp_path.iterdir() if psutil.pid_exists(int(sign.name))]
            if len(busy) == 2:
                victim = draw.choice(busy)
                with suppress(ProcessLookupError):
                    os.kill(int(victim.name), signal.SIGKILL)
                    deaths.append(victim)
                victim.unlink(missing_ok=True)

    killer, rounds = threading.Thread(target=kill), 0
    killer.start()
    try:
        while killer.is_alive():
            jobs = [(exec, (BUSY.format(folder=str(tmp_path)),))] * 12
            assert outcome(jobs, Workers(2, backend)) == [None] * 12
            rounds += 1
    finally:
        over.set()
        killer.join()
    figure("workers killed", len(deaths))
    figure("runs of 12 jobs completed", rounds)


@pytest.mark.parametrize("where", [Workers(1), Workers(2), Workers(2, "dask")])
def test_what_a_call_raises_before_it_is_sent_ends_the_run(where):
    def missing():
        raise InputError("there is nothing to work on")

    calls = [lambda: (math.sqrt, (4.0,)), missing, lambda: (math.sqrt, (4.0,))]
    with (
        workers(where),
        Interrupts() as interrupts,
        pytest.raises(InputError, match="there is nothing to work on"),
    ):
        list(answers(calls, where, interrupts))


@pytest.mark.parametrize("backend", BACKENDS)
def test_arguments_as_large_as_demonstrations_arrive(backend):
    large = np.ones((250, 100, 100))
    jobs = [(np.sum, (large + i,)) for i in range(6)]
    sums = [large.size * (1.0 + i) for i in range(6)]
    assert outcome(jobs, Workers(2, backend)) == sums


GROWING = """
import sys, time
sys.kept = [*getattr(sys, "kept", []), b"1" * 400_000_000]
time.sleep(1.1)
"""


def test_a_worker_that_grows_stays():
    """Loky looks for leaks at most once a second, and would warn in a thread of its own."""
    large = np.ones(100_000)  # more than a pipe holds, so that a lost reader is noticed
    grown = outcome([(exec, (GROWING, {"large": large}))] * 6, Workers(2))
    assert grown == [None] * 6


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_job_may_not_take_longer_than_the_limit(jobs):
    where = Workers(jobs, limit=0.3)
    quick, slow = outcome([(time.sleep, (0.01,)), (time.sleep, (30,))], where)
    assert quick is None
    assert slow.reason == "TimeoutError: more than the 0.005 minutes that a job may take"


@pytest.mark.parametrize(
    ("where", "answer"),
    [
        (Workers(1, "lok"), "did you mean 'loky'"),
        (Workers(1, "threading"), "share one memory"),
        (Workers(1, "multiprocessing"), "share one memory"),
        (Workers(1, "loky", "tcp://127.0.0.1:1"), "--scheduler is for the backend dask"),
        (Workers(1, "dask", "tcp://10.0.0.1:8786"), "takes tls://HOST:PORT"),
        (Workers(1, "dask", "example.org"), "takes tls://HOST:PORT"),
        (Workers(1, "dask", "http://localhost:1"), "takes tls://HOST:PORT"),
        (Workers(1, "dask", limit=60), "--limit is not for the backend dask"),
    ],
)
def test_what_cannot_be_used_is_refused(where, answer):
    with pytest.raises(InputError, match=answer), workers(where):
        pass


SLEEPERS = """
import sys, time
from functools import partial
from pathlib import Path
from bench.backend import Interrupts, Workers, answers, workers
def begin(folder, seconds):
    (folder / str(seconds)).touch()
    time.sleep(seconds)
where = Workers(int(sys.argv[1]))
jobs = [(begin, (Path(sys.argv[2]), seconds)) for seconds in (0, 2, 60, 61)]
with workers(where), Interrupts() as interrupts:
    for index, answer in answers([partial(tuple, job) for job in jobs], where, interrupts):
        print(index, flush=True)
    interrupts.check()
"""


@pytest.mark.parametrize(("jobs", "times"), [(1, 1), (2, 1), (2, 2)])
def test_ctrl_c_keeps_what_ends_soon_and_leaves_no_process(jobs, times, tmp_path, ends_within):
    running = subprocess.Popen(
        [sys.executable, "-c", SLEEPERS, str(jobs), str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert running.stdout.readline() == "0\n"
    while not (tmp_path / "2").exists():
        time.sleep(0.01)
    for _ in range(times):
        os.killpg(running.pid, signal.SIGINT)
        time.sleep(0.5)
    out, err = running.communicate(timeout=60)
    # Once: the job of 2 s may end. Twice: nothing may.
    assert out == ("1\n" if times == 1 else "")
    assert "KeyboardInterrupt" in err
    assert "stopping" in err
    assert ends_within(10, running.pid)


def dask_command(*options):
    return subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + options[0], *options[1:], "--no-dashboard"],
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


@pytest.fixture
def encrypted(tmp_path, monkeypatch):
    """A certificate, where dask's configuration names it here and in new processes."""
    pair = {"cert": str(tmp_path / "cert.pem"), "key": str(tmp_path / "key.pem")}
    signing = "openssl req -x509 -nodes -newkey rsa:2048 -days 1 -subj /CN=localhost"
    files = ["-keyout", pair["key"], "-out", pair["cert"]]
    subprocess.run([*signing.split(), *files], check=True, capture_output=True)
    tls = {"ca-file": pair["cert"], **dict.fromkeys(("scheduler", "worker", "client"), pair)}
    comm = {"require-encryption": True, "tls": tls}
    (tmp_path / "distributed.yaml").write_text(json.dumps({"distributed": {"comm": comm}}))
    monkeypatch.setenv("DASK_CONFIG", str(tmp_path))
    dask_config.refresh(paths=[str(tmp_path)])
    yield
    dask_config.refresh()


@pytest.fixture(params=["tcp", "tls"])
def scheduler(request, tmp_path):
    """The address of a dask scheduler with one worker, processes of their own."""
    if request.param == "tls":
        request.getfixturevalue("encrypted")
    file = tmp_path / "scheduler.json"
    address = (f"--protocol={request.param}", "--host=127.0.0.1", "--port=0")
    started = [dask_command("dask_scheduler", *address, f"--scheduler-file={file}")]
    while not file.exists() or not file.read_text():
        assert started[0].poll() is None
        time.sleep(0.1)
    address = json.loads(file.read_text())["address"]
    assert address.startswith(request.param)
    started.append(dask_command("dask_worker", address, "--nthreads=1", "--host=127.0.0.1"))
    yield address
    for process in started:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def test_a_dask_scheduler_elsewhere_does_the_jobs(scheduler):
    workers_of = Workers(1, "dask", scheduler)
    here, there = os.getpid(), outcome([(os.getpid, ())] * 3, workers_of)
    assert here not in there
    extra = dask_command("dask_worker", scheduler, "--nthreads=2", "--host=127.0.0.1")
    try:
        with pytest.raises(InputError, match="has 2 threads: start it with --nthreads 1"):
            meet_all(workers_of)
    finally:
        os.killpg(extra.pid, signal.SIGKILL)
        extra.wait()


def meet_all(where):
    """Looks at the workers until one that has just been started must be among them."""
    for _ in range(100):
        with workers(where):
            time.sleep(0.2)


def test_a_scheduler_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setattr("bench.backend.PATIENCE", 1)
    with (
        pytest.raises(InputError, match=r"no dask scheduler answers at 'tcp://127.0.0.1:9'"),
        workers(Workers(1, "dask", "tcp://127.0.0.1:9")),
    ):
        pass


def test_nothing_listens_beyond_this_machine():
    with workers(Workers(2, "dask")):
        me = psutil.Process()
        ports = [
            connection.laddr.ip
            for process in (me, *me.children(recursive=True))
            for connection in process.net_connections()
            if connection.status == psutil.CONN_LISTEN
        ]
    assert len(ports) >= 3
    assert set(ports) == {"127.0.0.1"}
