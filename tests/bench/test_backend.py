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
from dataclasses import replace
from functools import partial

import distributed  # noqa: F401, whose defaults dask's configuration must have
import numpy as np
import psutil
import pytest
from dask import config as dask_config

from bench.backend import TRIES, Listed, Workers, answers, workers
from bench.interrupts import Interrupts
from bench.isolation import Failure, apart
from tasks.errors import InputError

BACKENDS = ("loky", pytest.param("dask", marks=pytest.mark.long))


def on_dask(jobs):
    return pytest.param(Workers(jobs, "dask"), marks=pytest.mark.long)


def outcome(jobs, where):
    """The result of each job, in order; checks that no job gives two answers."""
    found = {}
    with workers(where), Interrupts() as interrupts:
        supply = Listed([partial(tuple, ("job", *job)) for job in jobs])
        for name, answer in answers(supply, where, interrupts):
            assert name not in found
            found[name] = answer.result
    return [found[str(index)] for index in range(len(jobs))]


@pytest.mark.parametrize("backend", ["sequential", *BACKENDS])
def test_a_job_that_raises_fails_with_its_reason_and_the_others_run(backend):
    jobs = [(math.sqrt, (value,)) for value in (4.0, -1.0, 9.0)]
    first, failure, last = outcome(jobs, Workers(2, backend))
    assert (first, last) == (2.0, 3.0)
    assert failure.reason.startswith("ValueError: ")
    assert "math" in failure.reason
    assert failure.tries == 1


@pytest.mark.parametrize("backend", ["loky", "dask"])
@pytest.mark.filterwarnings("ignore")  # of the worker that is no more
def test_a_job_that_kills_its_process_is_retried_alone_and_then_fails(backend):
    jobs = [(math.sqrt, (4.0,)), (os.abort, ()), *[(math.sqrt, (9.0,))] * 5]
    first, failure, *rest = outcome(jobs, Workers(2, backend))
    assert [first, *rest] == [2.0, *[3.0] * 5]
    assert isinstance(failure, Failure)
    assert failure.tries == TRIES
    assert failure.reason == "its process was killed by SIGABRT before it returned a result"


class Chain:
    """A chain of jobs, each of which needs the previous one, and as many independent jobs."""

    def __init__(self, length):
        self.todo = [f"{side}{i}" for i in range(length) for side in ("chain", "free")]
        self.done, self.sent = [], []

    def possible(self):
        done = {name for name in self.done if name.startswith("chain")}
        return [name for name in self.todo if name.startswith("free") or int(name[5:]) == len(done)]

    def take(self):
        for name in self.possible():
            self.todo.remove(name)
            self.sent.append(name)
            return name

    def call(self, name):
        return name, time.sleep, (0.05,)

    @property
    def ready(self):
        return bool(self.possible())

    @property
    def blocked(self):
        return bool(self.todo)


@pytest.mark.parametrize("backend", [*BACKENDS, "sequential"])
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_job_is_sent_once_the_results_it_needs_are_stored(backend, jobs):
    supply = Chain(5)
    where = Workers(jobs, backend)
    with workers(where), Interrupts() as interrupts:
        for name, answer in answers(supply, where, interrupts):
            assert not isinstance(answer.result, Failure)
            supply.done.append(name)
    assert len(supply.done) == len(set(supply.done)) == 10
    assert [name for name in supply.done if name.startswith("chain")] == [
        f"chain{i}" for i in range(5)
    ]


def test_two_runs_use_separate_dask_clusters():
    with workers(Workers(1, "dask")):
        assert outcome([(math.sqrt, (4.0,))], Workers(1, "dask")) == [2.0]


BUSY = """
import multiprocessing, os, pathlib, time
sign = pathlib.Path({folder!r}, str(os.getpid()))
sign.write_text(str(multiprocessing.parent_process().pid))
time.sleep(0.5)
sign.unlink()
"""


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.filterwarnings("ignore")
def test_other_jobs_survive_the_death_of_workers_and_processes(backend, times, tmp_path, figure):
    """Victims are chosen while two are busy, so that a job that is retried alone survives."""
    draw, over, deaths = np.random.default_rng(0), threading.Event(), []

    def kill():
        while len(deaths) < 2 + times and not over.wait(draw.uniform(0.1, 1)):
            # The signs of killed processes stay behind.
            busy = [sign for sign in tmp_path.iterdir() if psutil.pid_exists(int(sign.name))]
            if len(busy) == 2:
                sign = draw.choice(busy)
                with suppress(ProcessLookupError, FileNotFoundError, ValueError):
                    of_the_worker = draw.random() < 0.5
                    os.kill(int(sign.read_text() if of_the_worker else sign.name), signal.SIGKILL)
                    deaths.append(sign)
                sign.unlink(missing_ok=True)

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
    figure("workers and processes killed", len(deaths))
    figure("runs of 12 jobs completed", rounds)


@pytest.mark.parametrize("where", [Workers(1), Workers(2), on_dask(2)])
def test_an_error_while_preparing_a_call_ends_the_run(where):
    def missing():
        raise InputError("there is nothing to work on")

    calls = [lambda: ("job", math.sqrt, (4.0,)), missing, lambda: ("job", math.sqrt, (4.0,))]
    with (
        workers(where),
        Interrupts() as interrupts,
        pytest.raises(InputError, match="there is nothing to work on"),
    ):
        list(answers(Listed(calls), where, interrupts))


@pytest.mark.parametrize("backend", BACKENDS)
def test_jobs_receive_arguments_as_large_as_demonstrations(backend):
    large = np.ones((250, 100, 100))
    jobs = [(np.sum, (large + i,)) for i in range(6)]
    sums = [large.size * (1.0 + i) for i in range(6)]
    assert outcome(jobs, Workers(2, backend)) == sums


@pytest.mark.parametrize("where", [Workers(1), Workers(2), on_dask(1)])
def test_a_job_that_exceeds_the_time_limit_fails(where):
    where = replace(where, limit=1)
    endless = "while True:\n try: time.sleep(30)\n except BaseException: pass"
    quick, slow = outcome([(time.sleep, (0.01,)), (exec, ("import time\n" + endless,))], where)
    assert quick is None
    assert slow.reason == "it exceeded the limit of 0.0166667 minutes"


@pytest.mark.parametrize("where", [Workers(1), Workers(2)])
def test_the_time_limit_holds_for_a_job_that_closes_its_files(where):
    code = "import os, time\nos.closerange(3, 256)\ntime.sleep(60)"
    began = time.monotonic()
    (found,) = outcome([(exec, (code,))], replace(where, limit=2))
    assert found.reason.startswith("it exceeded the limit of")
    assert time.monotonic() - began < 40


VICES = {
    "exits": ("import sys; sys.exit(4)", "SystemExit: 4"),
    "interrupts": ("raise KeyboardInterrupt('mine')", "KeyboardInterrupt: mine"),
    "leaves": (
        "import os; os._exit(0)",
        "its process ended with exit code 0 before it returned a result",
    ),
    "asks": ("input()", "EOFError"),
    "hides": ("class E(Exception):\n def __str__(self): 1/0\nraise E()", "E: "),
    "recurses": ("f = lambda g: g(g)\nf(f)", "RecursionError"),
}


@pytest.mark.parametrize("where", [Workers(1), on_dask(2)])
@pytest.mark.filterwarnings("ignore")
def test_every_way_to_fail_gives_a_failure_with_its_reason(where):
    found = outcome([(exec, (code,)) for code, _ in VICES.values()], where)
    for failure, (_, reason) in zip(found, VICES.values(), strict=True):
        assert reason in failure.reason


def test_a_result_that_cannot_be_pickled_is_a_failure():
    (failure,) = outcome([(eval, ("lambda: 1",))], Workers(1))
    assert "pickle" in failure.reason


CHANGES = """
import os, random, signal, sys, threading, time, warnings
import numpy as np, torch
os.chdir("/"); os.environ["LEFT"] = "1"; os.umask(0)
torch.set_default_dtype(torch.float64); torch.set_num_threads(2); np.seterr(all="raise")
np.random.seed(7); np.linalg.solve = None; sys.path.insert(0, "/left"); sys.stdout = None
signal.signal(signal.SIGTERM, signal.SIG_IGN); warnings.simplefilter("ignore")
threading.Thread(target=time.sleep, args=(3600,)).start()
"""
STATE = """(
    __import__("os").environ.get("LEFT"), __import__("os").umask(0o22),
    str(__import__("torch").get_default_dtype()), __import__("torch").get_num_threads(),
    __import__("numpy").geterr()["over"], __import__("numpy").random.rand(),
    __import__("torch").rand(1).item(), __import__("random").random(),
    "/left" in __import__("sys").path, __import__("threading").active_count(),
    __import__("numpy").linalg.solve is None, __import__("signal").getsignal(15),
    len(__import__("os").listdir()),
)"""


@pytest.mark.parametrize("where", [Workers(1), Workers(2), on_dask(1)])
def test_changes_of_a_job_to_its_process_do_not_reach_the_next_job(where):
    before, *_, after = outcome(
        [(eval, (STATE,)), *[(exec, (CHANGES,))] * 4, (eval, (STATE,))], where
    )
    assert before == after
    assert before[0] is None
    assert before[-1] == 0


def test_output_of_a_job_is_shown_only_with_its_failure(capfd):
    said = "print('one ' * 20); import os; os.system('echo two'); os._exit(1)"
    quiet, failure = outcome([(exec, ("print('three')",)), (exec, (said,))], Workers(1))
    assert quiet is None
    assert "one one" in failure.traceback
    assert "two" in failure.traceback
    shown = "".join(capfd.readouterr())
    assert not {"one", "two", "three"} & set(shown.split())


LONG = """
import sys, time
from functools import partial
from bench.backend import Listed, Workers, answers, workers
from bench.interrupts import Interrupts
where = Workers(2, sys.argv[1])
jobs = [partial(tuple, ("job", exec, (sys.argv[2],)))] * 2
if __name__ == "__main__":
    with workers(where), Interrupts() as interrupts:
        list(answers(Listed(jobs), where, interrupts))
"""


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("harm", [signal.SIGKILL, signal.SIGHUP])
def test_no_process_and_no_warning_outlives_a_run_that_is_killed(backend, harm, tmp_path):
    (tmp_path / "long.py").write_text(LONG)
    mark = f"bench-test-{tmp_path.name}"
    begin = f"pathlib.Path({str(tmp_path)!r}, str(os.getpid())).touch()"
    job = f"import pathlib, os, time\n{begin}\ntime.sleep(600)"
    with (tmp_path / "said").open("w") as said:
        running = subprocess.Popen(
            [sys.executable, str(tmp_path / "long.py"), backend, job],
            env=os.environ | {"MARK": mark},
            stderr=said,
            start_new_session=True,
        )
    while sum(path.name.isdecimal() for path in tmp_path.iterdir()) < 2:
        time.sleep(0.05)
        assert running.poll() is None
    running.send_signal(harm)
    running.wait(timeout=30)
    end = time.monotonic() + 10
    while left := [p.pid for p in psutil.process_iter() if marked(p, mark)]:
        assert time.monotonic() < end, left
        time.sleep(0.1)
    assert "leaked" not in (tmp_path / "said").read_text()


def marked(process, mark):
    with suppress(psutil.Error):
        return process.environ().get("MARK") == mark and process.status() != "zombie"
    return False


@pytest.mark.parametrize(
    ("where", "answer"),
    [
        (Workers(1, "lok"), "did you mean 'loky'"),
        (Workers(1, "threading"), "runs jobs in shared memory"),
        (Workers(1, "multiprocessing"), "runs jobs in shared memory"),
        (Workers(1, "loky", "tcp://127.0.0.1:1"), "--scheduler is for the backend dask"),
        (Workers(1, "dask", "tcp://10.0.0.1:8786"), "takes tls://HOST:PORT"),
        (Workers(1, "dask", "example.org"), "takes tls://HOST:PORT"),
        (Workers(1, "dask", "http://localhost:1"), "takes tls://HOST:PORT"),
    ],
)
def test_unusable_backends_and_schedulers_are_refused(where, answer):
    with pytest.raises(InputError, match=answer), workers(where):
        pass


SLEEPERS = """
import sys
from functools import partial
from bench.backend import Listed, Workers, answers, workers
from bench.interrupts import Interrupts
begin = f"import pathlib, time; there = pathlib.Path({sys.argv[2]!r}); (there / 'begun').touch()\\n"
wait = "while not (there / 'end').exists(): time.sleep(0.01)"
codes = ["", begin + wait, *["import time; time.sleep(60)"] * 2]
where = Workers(int(sys.argv[1]))
calls = [partial(tuple, ("job", exec, (code,))) for code in codes]
with workers(where), Interrupts() as interrupts:
    for index, answer in answers(Listed(calls), where, interrupts):
        print(index, flush=True)
    interrupts.check()
"""


@pytest.mark.parametrize(("jobs", "times"), [(1, 1), (2, 1), (2, 2)])
def test_ctrl_c_keeps_results_that_end_soon_and_leaves_no_process(
    jobs, times, tmp_path, ends_within
):
    running = subprocess.Popen(
        [sys.executable, "-c", SLEEPERS, str(jobs), str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert running.stdout.readline() == "0\n"
    while not (tmp_path / "begun").exists():
        assert running.poll() is None
        time.sleep(0.01)
    for _ in range(times):
        os.killpg(running.pid, signal.SIGINT)
        time.sleep(0.5)
    (tmp_path / "end").touch()
    out, err = running.communicate(timeout=60)
    # After one signal the result of a job that ends soon is kept; after two, none is.
    assert out == ("1\n" if times == 1 else "")
    assert "Stop" in err
    assert "stopping" in err
    assert ends_within(10, running.pid)


STOPPABLE = """
import sys, time
import bench.interrupts
bench.interrupts.GRACE = 0.2
with bench.interrupts.Interrupts():
    print("ready", flush=True)
    time.sleep(600)
"""


def test_sigterm_ends_a_run_that_ignores_ctrl_c():
    """A shell starts what a script puts into the background with SIGINT ignored."""
    running = subprocess.Popen(
        ["sh", "-c", 'trap "" INT; exec "$0" -c "$1"', sys.executable, STOPPABLE],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert running.stdout.readline() == "ready\n"
    running.terminate()
    assert "Stop" in running.communicate(timeout=60)[1]


def test_the_end_of_a_job_leaves_processes_of_others_alone():
    with subprocess.Popen(["sleep", "600"], start_new_session=True) as mine:
        assert apart(int, "3") == 3
        assert mine.poll() is None
        mine.kill()


def dask_command(*options):
    return subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + options[0], *options[1:], "--no-dashboard"],
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


@pytest.fixture
def encrypted(tmp_path, monkeypatch):
    """A TLS certificate that dask's configuration names, here and in new processes."""
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
    """The address of a dask scheduler with one worker, in separate processes."""
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


def test_a_remote_dask_scheduler_runs_the_jobs(scheduler):
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
    """Observes the workers long enough to include one that has just started."""
    for _ in range(100):
        with workers(where):
            time.sleep(0.2)


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    monkeypatch.setattr("bench.dask_backend.PATIENCE", 1)
    with (
        pytest.raises(InputError, match=r"no dask scheduler answers at 'tcp://127.0.0.1:9'"),
        workers(Workers(1, "dask", "tcp://127.0.0.1:9")),
    ):
        pass


def test_a_local_dask_cluster_listens_on_loopback_only():
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
