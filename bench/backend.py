"""Runs jobs on joblib's backends, and retries a job whose worker dies.

A worker does not compute. It starts a process for each job and waits for it, see `bench.isolation`.
"""

import multiprocessing.resource_tracker
import os
import pickle
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from time import perf_counter, sleep
from typing import Any, Protocol

from joblib import Parallel, delayed, parallel_config
from joblib.externals import loky
from joblib.parallel import BACKENDS, EXTERNAL_BACKENDS

from bench.dask_backend import DaskBackend, dask_client
from bench.interrupts import Interrupts
from bench.isolation import Failure, Job, do_apart, do_here, read_answer, start_server
from tasks.errors import InputError, unknown_name
from tasks.pins import check_early, check_environment
from tasks.words import count_of

TRIES = 3
"""Attempts, each alone, for a job whose process died: memory may have run out."""
IDLE = 0.1
"""Seconds after which a worker without a job asks again."""
SHARED_MEMORY = ("multiprocessing", "threading")
"""Refused: simulations hang in forked processes, and threads share the random state of torch."""

IN_THIS_PROCESS = "sequential"
"""The backend that runs jobs in the calling process, for tests and debuggers."""
ORPHANED = 0.5
"""Seconds between two checks of a worker whether its run still exists."""

LEFT = "ignore:resource_tracker:UserWarning"
"""Filter of the warnings that a killed run has left semaphores and folders, which are removed."""

Call = tuple[str, Job, tuple[Any, ...]]
"""The label of a job, a function and its arguments."""


@dataclass(frozen=True)
class Answer:
    """The outcome of a job."""

    result: Any
    """What the job returned, or a `Failure`."""
    seconds: float
    """Wall time, without waiting for a worker."""


@dataclass(frozen=True)
class Workers:
    """Where jobs run, and how many in parallel."""

    jobs: int
    """Number of parallel jobs."""
    backend: str = "loky"
    """loky, dask, or the name of another backend that is registered with joblib."""
    scheduler: str | None = None
    """Address of a dask scheduler. Default: a cluster on this machine."""
    limit: float = 12 * 3600.0
    """Seconds after which a job is killed and fails. Not enforced in this process."""

    def check(self) -> None:
        """Checks that jobs can run there.

        Raises:
            InputError: the backend does not exist or cannot be used, or its jobs would have other
                kernels than this process promises, see `tasks.pins`.
        """
        known = [name for name in {**BACKENDS, **EXTERNAL_BACKENDS} if name not in SHARED_MEMORY]
        if self.backend in SHARED_MEMORY:
            raise InputError(
                f"backend {self.backend!r} runs jobs in shared memory, where they would affect each"
                f" other: choose from {', '.join(known)}"
            )
        if self.backend not in known:
            raise unknown_name("backend", self.backend, known)
        if self.scheduler is not None and self.backend != "dask":
            raise InputError(f"--scheduler is for the backend dask, not for {self.backend!r}")
        check_environment()
        if self.backend == IN_THIS_PROCESS:
            check_early()


@contextmanager
def workers(where: Workers) -> Iterator[int]:
    """Chooses the backend that `answers` sends jobs to; yields the number of its workers.

    Raises:
        InputError: the backend does not exist or cannot be used.
    """
    where.check()
    if where.backend != IN_THIS_PROCESS:
        _start_trackers()
    if where.backend == "dask":
        with (
            dask_client(where.scheduler, where.jobs) as client,
            parallel_config(DaskBackend(client)),
        ):
            yield sum(client.ncores().values())
    elif where.backend == "loky":
        with (
            parallel_config("loky", inner_max_num_threads=1, initializer=_prepare_worker),
            warnings.catch_warnings(),
        ):
            # If warnings are errors, this one would end the thread that collects loky's answers.
            warnings.filterwarnings("ignore", "A worker stopped while some jobs")
            yield where.jobs
    else:
        with parallel_config(where.backend):
            yield where.jobs


class Supply(Protocol):
    """Jobs that become possible as others end. Its methods are called from several threads."""

    def take(self) -> str | None:
        """Returns the name of the job to send next, or None if none is possible now."""

    def call(self, name: str) -> Call:
        """Returns the call of a job that was taken. Called again for a second attempt."""

    @property
    def ready(self) -> bool:
        """Whether `take` would return a job."""

    @property
    def blocked(self) -> bool:
        """Whether jobs wait for the results of others."""


class Listed:
    """A supply of jobs that do not depend on each other, named ``0``, ``1`` and so on."""

    blocked = False

    def __init__(self, calls: Sequence[Callable[[], Call]]) -> None:
        self._calls, self._left = calls, list(map(str, range(len(calls))))

    def take(self) -> str | None:
        """See `Supply.take`."""
        return self._left.pop(0) if self._left else None

    def call(self, name: str) -> Call:
        """See `Supply.call`."""
        return self._calls[int(name)]()

    @property
    def ready(self) -> bool:
        """See `Supply.ready`."""
        return bool(self._left)


def answers(supply: Supply, where: Workers, interrupts: Interrupts) -> Iterator[tuple[str, Answer]]:
    """Yields the answer of each job with its name, as they end.

    A job whose process or worker dies is retried alone, once no other job is possible: it then has
    all the memory, and its death harms no other job.

    Args:
        supply: the jobs. What its methods raise is raised here.
        where: as given to `workers`.
        interrupts: says when to stop sending.
    """
    if where.backend == "loky":
        _start_loky(where.jobs)
    died: list[str] = []
    while not interrupts.asked:
        if supply.ready:
            for name, answer in _pooled(_Sending(supply, where, interrupts)):
                if isinstance(answer.result, Failure) and answer.result.died:
                    died.append(name)
                else:
                    yield name, answer
        elif died:
            name = died.pop(0)
            yield name, _alone(supply.call(name), where)
        else:
            return


@dataclass
class _Sending:
    """The jobs that a pool of workers gets."""

    supply: Supply
    where: Workers
    interrupts: Interrupts
    pending: dict[str, None] = field(default_factory=dict)
    """Names of the jobs that were sent and have not been answered."""
    closed: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)
    error: Exception | None = None
    """The error that the supply raised."""

    def tasks(self) -> Iterator[Any]:
        """Yields what joblib sends: at first a job for each worker, then one for each that ends."""
        while not self.interrupts.asked:
            try:
                name = self._take()
                call = self.supply.call(name) if name is not None else None
            except Exception as error:
                self.error = error
                raise
            if name is not None and call is not None:
                yield _delayed(name, call, self.where)
            elif self.supply.ready and not self.closed:
                continue  # another job has just ended
            elif self.pending and self.supply.blocked:
                yield delayed(_idle)()
            else:
                return

    def _take(self) -> str | None:
        with self.lock:
            name = None if self.closed else self.supply.take()
            if name is not None:
                self.pending[name] = None
            return name

    def close(self) -> list[str]:
        """Sends no more, whatever joblib still asks for; returns the jobs without an answer."""
        with self.lock:
            self.closed = True
            lost = list(self.pending)
            self.pending.clear()
            return lost


def _pooled(sending: _Sending) -> Iterator[tuple[str, Answer]]:
    """Yields the answers of jobs done side by side, until none is possible any more.

    When a worker dies, all jobs that were sent count as dead.
    """
    try:
        for name, answer in _parallel(sending.where)(sending.tasks()):
            if name:
                yield name, answer
                sending.pending.pop(name)
    except Exception:
        if sending.error:
            raise sending.error from None
        # A job's own exception is part of its answer. This one is the backend's: a worker died.
    for name in sending.close():
        yield name, Answer(Failure("its worker died", "", died=True), 0.0)


def _idle() -> tuple[str, None]:
    """Keeps a worker busy while all remaining jobs wait for the results of others."""
    sleep(IDLE)
    return "", None


def _delayed(name: str, call: Call, where: Workers) -> Any:
    label, job, arguments = call
    if where.backend == IN_THIS_PROCESS:
        return delayed(_attempt_here)(name, label, job, arguments)
    # Pickled here, and unpickled only in the process of the job.
    return delayed(_attempt)(name, label, pickle.dumps((job, arguments), protocol=5), where.limit)


def _start_loky(jobs: int) -> None:
    """Starts the workers if they do not run yet, deaf to a terminal's Ctrl-C from the beginning.

    Otherwise a worker that is still starting would die of Ctrl-C, and with it the others' jobs.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        Parallel(max(2, jobs))(delayed(os.getpid)() for _ in range(max(2, jobs)))
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_trackers() -> None:
    """Starts the processes that remove what a killed run leaves, if they do not run yet.

    They get the warning filters of this process, and with them `LEFT`. They start before
    `_start_loky` blocks a signal, which starting them would unblock.
    """
    sys.warnoptions.append(LEFT)
    try:
        for tracker in (multiprocessing.resource_tracker, loky.backend.resource_tracker):
            tracker.ensure_running()
    finally:
        sys.warnoptions.remove(LEFT)


def _parallel(where: Workers) -> Parallel:
    # Jobs are sent only to free workers, so that few must be retried when a worker dies.
    options = {"return_as": "generator_unordered", "batch_size": 1}
    if where.backend != "loky":
        return Parallel(where.jobs, pre_dispatch="n_jobs", **options)
    # With one worker joblib would run jobs in this process. There are two, and one waits.
    return Parallel(max(2, where.jobs), pre_dispatch=where.jobs, **options)


def _alone(call: Call, where: Workers) -> Answer:
    """Runs a job with no other beside it; up to `TRIES` attempts if its process dies."""
    for tries in range(1, TRIES + 1):
        try:
            ((_, answer),) = _parallel(replace(where, jobs=1))([_delayed("alone", call, where)])
        except Exception as error:
            reason = f"its worker died {count_of(tries, 'time')} ({type(error).__name__})"
            answer = Answer(Failure(reason, str(error), tries, died=True), 0.0)
        if not (isinstance(answer.result, Failure) and answer.result.died):
            break
    if isinstance(answer.result, Failure):
        return replace(answer, result=replace(answer.result, tries=tries))
    return answer


def _attempt_here(
    name: str, label: str, job: Job, arguments: tuple[Any, ...]
) -> tuple[str, Answer]:
    began = perf_counter()
    return name, Answer(do_here(label, job, arguments), perf_counter() - began)


def _attempt(name: str, label: str, call: bytes, limit: float) -> tuple[str, Answer]:
    began = perf_counter()
    return name, Answer(read_answer(do_apart(label, call, limit)), perf_counter() - began)


def _prepare_worker() -> None:
    """Makes a loky worker deaf to a terminal's Ctrl-C, and lets it end with its run."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    start_server()
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()


def _end_with(run: int) -> None:
    while os.getppid() == run:
        sleep(ORPHANED)
    os._exit(1)
