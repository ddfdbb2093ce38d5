"""Uses dask as a backend of joblib: a cluster on this machine, or a remote scheduler."""

from collections.abc import Iterator
from contextlib import contextmanager
from ipaddress import ip_address
from typing import Any
from urllib.parse import urlsplit

from joblib.parallel import ParallelBackendBase

from bench.doing import say
from tasks.errors import InputError

PATIENCE = 10
"""Seconds in which a dask scheduler must answer."""
DASK_CONFIG = {
    # Jobs carry their demonstrations, tens of megabytes, on purpose.
    "distributed.admin.large-graph-warning-threshold": "1GB",
    # A job that kills its worker is retried by the run, alone, so that it harms no other job.
    "distributed.scheduler.allowed-failures": 0,
    # By default a cluster drops a worker that takes 15 s to restart or dies again within them. Once
    # the last worker is dropped, jobs would wait forever.
    "distributed.deploy.lost-worker-timeout": "1h",
    "distributed.scheduler.no-workers-timeout": "5m",
}
"""Settings for a cluster on this machine. A scheduler elsewhere uses only the first of them."""


@contextmanager
def dask_client(scheduler: str | None, jobs: int) -> Iterator[Any]:
    """Connects to a scheduler, or starts a cluster with a number of workers on this machine.

    Raises:
        InputError: no scheduler answers, its connection is open to others, or one of its workers
            has several threads.
    """
    import dask

    with dask.config.set(DASK_CONFIG), _client(scheduler, jobs) as client:
        yield client


@contextmanager
def _client(scheduler: str | None, jobs: int) -> Iterator[Any]:
    from distributed import Client, LocalCluster

    if scheduler is None:
        cluster = LocalCluster(
            n_workers=jobs,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address=None,
            worker_dashboard_address=None,
            # Even without a dashboard it serves a health page, on a port that may be taken.
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
        say(f"waiting for a worker of {scheduler}")
        client.wait_for_workers(1)
        threads = {name: w["nthreads"] for name, w in client.scheduler_info(-1)["workers"].items()}
        for name, count in threads.items():
            if count != 1:
                raise InputError(
                    f"dask worker {name} has {count} threads: start it with --nthreads 1"
                )
        yield client


class DaskBackend(ParallelBackendBase):
    """Sends joblib's jobs to a dask cluster.

    joblib's own dask backend waits forever for a job whose worker died, runs jobs in this process
    while the cluster has one worker, and leaves aborted jobs running.
    """

    supports_retrieve_callback = True
    supports_return_generator = True

    def __init__(self, client: Any) -> None:
        super().__init__()
        self._client = client
        self._sent: set[Any] = set()

    def effective_n_jobs(self, n_jobs: int) -> int:
        """Returns the number of workers, at least two: for one, joblib would run jobs here."""
        return max(2, sum(self._client.ncores().values()))

    def submit(self, func: Any, callback: Any = None) -> Any:
        """Sends a job. The callback gets its result, or the exception that it raised."""
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
        """Returns what the callback got; raises it if it is an exception."""
        if isinstance(out, BaseException):
            raise out
        return out

    def abort_everything(self, ensure_ready: bool = True) -> None:
        """Cancels the jobs that have not ended."""
        self._client.cancel(list(self._sent), force=True)
        self._sent.clear()


def _check_address(scheduler: str) -> None:
    """Refuses an address that would send demonstrations and code unencrypted over a network."""
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
