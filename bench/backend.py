"""Where jobs run: joblib's backends, what becomes of a job whose worker dies, and Ctrl-C.

A worker does not compute: it starts a process for each job and waits for it, see `bench.isolation`.
"""

import multiprocessing.resource_tracker
import os
import pickle
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from ipaddress import ip_address
from time import perf_counter, sleep
from types import FrameType
from typing import Any
from urllib.parse import urlsplit

from joblib import Parallel, delayed, parallel_config
from joblib.externals import loky
from joblib.parallel import BACKENDS, EXTERNAL_BACKENDS, ParallelBackendBase

from bench.isolation import Failure, Job, Stop, do_apart, do_here, read_answer, start_server
from tasks.errors import InputError, unknown_name
from tasks.words import count_of

TRIES = 3
"""Attempts, with nothing beside it, for a job whose process died: memory may have run out."""
GRACE = 4.0
"""Seconds after Ctrl-C in which what ends is still kept."""
PATIENCE = 10
"""Seconds in which a dask scheduler must answer."""
DASK_CONFIG = {
    # Jobs carry their demonstrations, tens of megabytes, on purpose.
    "distributed.admin.large-graph-warning-threshold": "1GB",
    # Who kills its worker is tried again here, alone, rather than beside innocent jobs.
    "distributed.scheduler.allowed-failures": 0,
    # A cluster gives up a worker that takes 15 s to start again, or dies a second time within them,
    # and with the last one jobs would wait for ever.
    "distributed.deploy.lost-worker-timeout": "1h",
    "distributed.scheduler.no-workers-timeout": "5m",
}
"""For a cluster of this machine's own; of a scheduler elsewhere, only the first entry is heard."""
SHARED_MEMORY = ("multiprocessing", "threading")
"""Backends that are refused: simulations hang in forked processes, and threads share the random
stream that torch initialises networks from."""

IN_THIS_PROCESS = "sequential"
"""The backend that does jobs in the calling process, for tests and debuggers."""
ORPHANED = 0.5
"""Seconds between two looks of a worker at whether its run still exists."""

Call = tuple[str, Job, tuple[Any, ...]]
"""The name of a job, and what is called with which arguments."""


@dataclass(frozen=True)
class Answer:
    """What became of a job."""

    result: Any
    """What the job returned, or a `Failure`."""
    seconds: float


@dataclass(frozen=True)
class Workers:
    """Who does the jobs."""

    jobs: int
    """How many at a time."""
    backend: str = "loky"
    """loky, dask, or the name under which another is registered with joblib."""
    scheduler: str | None = None
    """Address of a dask scheduler; a cluster of this machine's own unless told."""
    limit: float = 12 * 3600.0
    """Seconds after which a job fails; not in this process, where nothing can end it."""

    def check(self) -> None:
        """Raises InputError if there is no such backend, or it cannot be used so."""
        known = [name for name in {**BACKENDS, **EXTERNAL_BACKENDS} if name not in SHARED_MEMORY]
        if self.backend in SHARED_MEMORY:
            raise InputError(
                f"the jobs of backend {self.backend!r} share one memory, and ours must not: choose"
                f" from {', '.join(known)}"
            )
        if self.backend not in known:
            raise unknown_name("backend", self.backend, known)
        if self.scheduler is not None and self.backend != "dask":
            raise InputError(f"--scheduler is for the backend dask, not for {self.backend!r}")


class Interrupts:
    """Turns Ctrl-C, SIGTERM or SIGHUP into a request to stop; the second one stops at once.

    After the first no more jobs are sent, and what ends within `GRACE` is kept. A context manager.
    """

    def __init__(self) -> None:
        self.asked = False
        self._timer = threading.Timer(GRACE, os.kill, (os.getpid(), signal.SIGINT))
        self._timer.daemon = True

    def __enter__(self) -> "Interrupts":
        heard = threading.current_thread() is threading.main_thread()
        numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP) if heard else ()
        ignored = {number for number in numbers if signal.getsignal(number) is signal.SIG_IGN}
        self._before = {
            number: signal.signal(number, self._stop) for number in numbers if number not in ignored
        }
        return self

    def __exit__(self, *error: object) -> None:
        self._timer.cancel()
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def check(self) -> None:
        """Raises Stop if a stop was asked for."""
        if self.asked:
            raise Stop

    def _stop(self, number: int, frame: FrameType | None) -> None:
        self.check()
        self.asked = True
        with suppress(OSError):  # the terminal may have gone
            print(
                f"stopping: what ends within {GRACE:.0f} s is kept; Ctrl-C again stops at once",
                file=sys.stderr,
            )
        self._timer.start()


@contextmanager
def workers(where: Workers) -> Iterator[None]:
    """Sends the jobs of `answers` to a backend.

    Raises:
        InputError: there is no such backend, or it cannot be used so.
    """
    where.check()
    if where.backend == "dask":
        with (
            _dask_client(where.scheduler, where.jobs) as client,
            parallel_config(DaskBackend(client)),
        ):
            yield
    elif where.backend == "loky":
        with (
            parallel_config("loky", inner_max_num_threads=1, initializer=_prepare_worker),
            warnings.catch_warnings(),
        ):
            # Where warnings are errors, this one would end the thread that loky hears answers by.
            warnings.filterwarnings("ignore", "A worker stopped while some jobs")
            yield
    else:
        with parallel_config(where.backend):
            yield


def answers(
    calls: Sequence[Callable[[], Call]], where: Workers, interrupts: Interrupts
) -> Iterator[tuple[int, Answer]]:
    """Yields the answer of each job with its index, as they end.

    A job whose process or worker dies is tried again once the others have ended, alone, so that it
    has all the memory and nothing else is lost with it.

    Args:
        calls: each returns a call, once it is to be sent; what it raises is raised.
        where: what `workers` was given.
        interrupts: when to stop sending.
    """

    def send(indices: Iterable[int]) -> Iterator[Any]:
        for index in indices:
            if interrupts.asked:
                return
            try:
                call = calls[index]()
            except Exception as error:
                ours.append(error)
                raise
            sent.append(index)
            yield _delayed(index, call, where)

    if where.backend == "loky":
        _start_loky(where.jobs)
    ours: list[Exception] = []
    died: list[int] = []
    left = dict.fromkeys(range(len(calls)))
    while left and not interrupts.asked:
        sent: list[int] = []
        try:
            for index, answer in _parallel(where)(send(list(left))):
                del left[index]
                if isinstance(answer.result, Failure) and answer.result.died:
                    died.append(index)
                else:
                    yield index, answer
        except Exception:
            if ours:
                raise ours[0] from None
            # A job returns what it raises: this comes from the backend, which has lost a worker.
            lost = [index for index in sent if index in left]
            died += lost
            for index in lost:
                del left[index]
    for index in died:
        if interrupts.asked:
            return
        yield index, _alone(calls[index](), where)


def _delayed(index: int, call: Call, where: Workers) -> Any:
    name, job, arguments = call
    if where.backend == IN_THIS_PROCESS:
        return delayed(_attempt_here)(index, name, job, arguments)
    # Pickled here, and not looked into until it has arrived in the process of the job.
    return delayed(_attempt)(index, name, pickle.dumps((job, arguments), protocol=5), where.limit)


def _start_loky(jobs: int) -> None:
    """Starts the workers, unless they are there, deaf to a terminal's Ctrl-C from the beginning.

    Without that, one that is still starting would die of it, and take the others' jobs with it.
    """
    # The trackers unblock the signal when they are started, which otherwise the first worker does.
    for tracker in (multiprocessing.resource_tracker, loky.backend.resource_tracker):
        tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        Parallel(max(2, jobs))(delayed(os.getpid)() for _ in range(max(2, jobs)))
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _parallel(where: Workers) -> Parallel:
    # No more is sent than works, so that few are under suspicion when a worker dies.
    options = {"return_as": "generator_unordered", "batch_size": 1}
    if where.backend != "loky":
        return Parallel(where.jobs, pre_dispatch="n_jobs", **options)
    # Joblib does what is for one worker in the calling process, so there are two: one waits.
    return Parallel(max(2, where.jobs), pre_dispatch=where.jobs, **options)


def _alone(call: Call, where: Workers) -> Answer:
    """The answer of a job that nothing else runs beside."""
    for tries in range(1, TRIES + 1):
        try:
            ((_, answer),) = _parallel(replace(where, jobs=1))([_delayed(0, call, where)])
        except Exception as error:
            reason = f"its worker died {count_of(tries, 'time')} ({type(error).__name__})"
            answer = Answer(Failure(reason, str(error), tries, died=True), 0.0)
        if not (isinstance(answer.result, Failure) and answer.result.died):
            break
    if isinstance(answer.result, Failure):
        return replace(answer, result=replace(answer.result, tries=tries))
    return answer


def _attempt_here(
    index: int, name: str, job: Job, arguments: tuple[Any, ...]
) -> tuple[int, Answer]:
    began = perf_counter()
    return index, Answer(do_here(name, job, arguments), perf_counter() - began)


def _attempt(index: int, name: str, call: bytes, limit: float) -> tuple[int, Answer]:
    began = perf_counter()
    return index, Answer(read_answer(do_apart(name, call, limit)), perf_counter() - began)


def _prepare_worker() -> None:
    """Makes a worker of loky deaf to a terminal's Ctrl-C, and ends it with its run."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    start_server()
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()


def _end_with(run: int) -> None:
    while os.getppid() == run:
        sleep(ORPHANED)
    os._exit(1)


@contextmanager
def _dask_client(scheduler: str | None, jobs: int) -> Iterator[Any]:
    import dask
    from distributed import Client, LocalCluster

    dask.config.set(DASK_CONFIG)
    if scheduler is None:
        cluster = LocalCluster(
            n_workers=jobs,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address=None,
            worker_dashboard_address=None,
            # Without a dashboard it still serves its health, on a port that others may have taken.
            scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
        )
        with cluster, Client(cluster) as client:
            yield client
        return
    _check_address(scheduler)
    try:
        client = Client(scheduler, timeout=PATIENCE)
    except OSError as error:
        raise InputError(f"no dask scheduler answers at {scheduler!r}: {error}") from error
    with client:
        threads = {name: w["nthreads"] for name, w in client.scheduler_info(-1)["workers"].items()}
        for name, count in threads.items():
            if count != 1:
                raise InputError(
                    f"dask worker {name} has {count} threads: start it with --nthreads 1"
                )
        yield client


class DaskBackend(ParallelBackendBase):
    """Hands joblib's jobs to a dask cluster.

    Joblib has such a backend, but waits for ever for a job that is lost with its worker, does the
    jobs itself while the cluster has one worker, and leaves aborted jobs running.
    """

    supports_retrieve_callback = True
    supports_return_generator = True

    def __init__(self, client: Any) -> None:
        super().__init__()
        self._client = client
        self._sent: set[Any] = set()

    def effective_n_jobs(self, n_jobs: int) -> int:
        """Returns how many workers there are; of one, joblib would make none."""
        return max(2, sum(self._client.ncores().values()))

    def submit(self, func: Any, callback: Any = None) -> Any:
        """Sends a job; the callback gets what it returns, or the exception that it met with."""
        future = self._client.submit(func, pure=False)
        self._sent.add(future)

        def deliver(done: Any) -> None:
            self._sent.discard(done)
            try:
                outcome = done.result()
            except BaseException as error:
                outcome = error
            callback(outcome)

        future.add_done_callback(deliver)
        return future

    def retrieve_result_callback(self, out: Any) -> Any:
        """Returns what the callback got, or raises it."""
        if isinstance(out, BaseException):
            raise out
        return out

    def abort_everything(self, ensure_ready: bool = True) -> None:
        """Cancels the jobs that are on their way."""
        self._client.cancel(list(self._sent), force=True)
        self._sent.clear()


def _check_address(scheduler: str) -> None:
    """Refuses what would send demonstrations and code over a network in the open."""
    parts = urlsplit(scheduler)
    try:
        loopback = parts.hostname == "localhost" or ip_address(parts.hostname or "").is_loopback
    except ValueError:
        loopback = False
    if not (parts.scheme == "tls" or (parts.scheme == "tcp" and loopback)):
        raise InputError(
            f"--scheduler takes tls://HOST:PORT, or tcp://127.0.0.1:PORT, got {scheduler!r}:"
            " whoever reaches a plain dask scheduler can run code on its workers"
        )
