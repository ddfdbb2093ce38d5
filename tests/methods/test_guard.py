"""Changes of the process are named and reverted."""

import gc
import locale
import logging
import multiprocessing
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import warnings

import numpy as np
import pytest
import torch

from methods.guard import guarded
from methods.nn import NN
from methods.process_state import PARTS

CHANGES = {
    "the current folder": lambda: os.chdir("/"),
    "environment variables": lambda: os.environ.update(OMP_NUM_THREADS="7"),
    "the umask": lambda: os.umask(0o077),
    "signal handlers": lambda: signal.signal(signal.SIGTERM, signal.SIG_IGN),
    "resource limits": lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (512, HARD)),
    "the allowed processor cores": lambda: os.sched_setaffinity(0, {CORE}),
    "the locale": lambda: locale.setlocale(locale.LC_NUMERIC, OTHER_LOCALE),
    "sys.path": lambda: sys.path.append("/elsewhere"),
    "the recursion limit": lambda: sys.setrecursionlimit(5000),
    "the standard streams": lambda: setattr(sys, "stdout", None),
    "exception hooks": lambda: setattr(sys, "excepthook", print),
    "garbage collection": gc.disable,
    "logging": lambda: logging.disable(logging.CRITICAL),
    "warnings.showwarning": lambda: setattr(warnings, "showwarning", print),
    "the temporary folder": lambda: setattr(tempfile, "tempdir", "/elsewhere"),
    "the start method of processes": lambda: multiprocessing.set_start_method("spawn", force=True),
    "the global random stream of random": random.random,
    "the global random stream of NumPy": np.random.rand,
    "the global random stream of torch": lambda: torch.rand(1),
    "NumPy's error state": lambda: np.seterr(all="raise"),
    "NumPy's error callback": lambda: np.seterrcall(print),
    "NumPy's print options": lambda: np.set_printoptions(precision=1),
    "torch's default dtype": lambda: torch.set_default_dtype(torch.float64),
    "torch's default device": lambda: torch.set_default_device("meta"),
    "torch's threads": lambda: torch.set_num_threads(2),
    "torch's gradient mode": lambda: torch.set_grad_enabled(False),
    "torch's anomaly mode": lambda: torch.autograd.set_detect_anomaly(True),
    "torch's deterministic mode": lambda: torch.use_deterministic_algorithms(True),
    "torch's matmul precision": lambda: torch.set_float32_matmul_precision("medium"),
    "oneDNN in torch": lambda: torch.backends.mkldnn.set_flags(False),
    "denormal numbers": lambda: torch.set_flush_denormal(True),
    "the warning filters": lambda: warnings.simplefilter("ignore"),
    "numpy.linalg.solve": lambda: setattr(np.linalg, "solve", None),
    "NN.draw": lambda: setattr(NN, "draw", None),
    "NN.rollout": lambda: setattr(NN, "rollout", len),
    "child process sleep": lambda: subprocess.Popen(["sleep", "60"]),
}
HARD = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
CORE = min(os.sched_getaffinity(0))
OTHER_LOCALE = next(
    name for name in ("C.UTF-8", "C") if name != locale.setlocale(locale.LC_NUMERIC)
)


def state():
    found = {part.name: part.read() for part in PARTS}
    return found | {"functions": (np.linalg.solve, NN.draw, NN.rollout, list(warnings.filters))}


@pytest.mark.filterwarnings("ignore:subprocess:ResourceWarning")
@pytest.mark.parametrize("name", CHANGES)
def test_a_change_of_the_process_is_named_and_reverted(name):
    if name == "the allowed processor cores" and len(os.sched_getaffinity(0)) == 1:
        pytest.skip("there is one core to choose")
    before = state()
    with guarded("test") as changed:
        CHANGES[name]()
    assert name in changed
    assert state() == before


def test_every_part_of_the_state_has_a_test():
    assert {part.name for part in PARTS} - set(CHANGES) == {"tracing"}


def test_code_that_changes_nothing_is_reported_as_unchanged():
    with guarded("test") as changed:
        np.linalg.solve(np.eye(2), np.ones(2))
    assert changed == []


def test_global_random_streams_are_seeded_by_the_computation():
    def drawn(*stream):
        with guarded(*stream):
            return random.random(), np.random.rand(), torch.rand(1).item()  # noqa: NPY002

    assert drawn("one", 1) == drawn("one", 1)
    assert len({*drawn("one", 1), *drawn("one", 2)}) == 6


def test_code_runs_in_an_empty_folder_that_is_removed():
    with guarded("test"):
        assert os.listdir() == []
        place = os.getcwd()
        open("best.npz", "w").close()
    assert not os.path.exists(place)


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_copy_ends_with_the_block_and_leaves_the_folder():
    with guarded("forks"):
        copy = os.fork()
        if copy:
            assert os.waitpid(copy, 0)[1] == 0
            assert os.listdir(os.getcwd()) == []
    if not copy:
        os._exit(1)
