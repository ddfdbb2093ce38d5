"""The parts of a process's state that a method may change, with functions to read and set them.

`methods.guard` restores them after a method has run.
"""

import gc
import locale
import logging
import multiprocessing
import os
import random
import resource
import signal
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch


@dataclass(frozen=True)
class Part:
    """One part of the state of the process."""

    name: str
    read: Callable[[], Any]
    """Returns a comparable value, which `write` accepts."""
    write: Callable[[Any], object]


def _folder() -> str:
    try:
        return os.getcwd()
    except FileNotFoundError:
        return "removed"


def _set_environment(variables: dict[str, str]) -> None:
    os.environ.clear()
    os.environ.update(variables)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _signals() -> dict[int, Any]:
    return {number: signal.getsignal(number) for number in signal.valid_signals()}


def _set_signals(handlers: dict[int, Any]) -> None:
    if threading.current_thread() is not threading.main_thread():
        return
    for number, handler in handlers.items():
        if signal.getsignal(number) is not handler and handler is not None:
            signal.signal(number, handler)


def _limits() -> dict[int, tuple[int, int]]:
    kinds = ("AS", "CPU", "DATA", "FSIZE", "NOFILE", "STACK")
    numbers = [getattr(resource, f"RLIMIT_{kind}") for kind in kinds]
    return {number: resource.getrlimit(number) for number in numbers}


def _set_limits(limits: dict[int, tuple[int, int]]) -> None:
    for number, limit in limits.items():
        with suppress(ValueError, OSError):  # a lowered hard limit cannot be raised again
            resource.setrlimit(number, limit)


def _numpy_stream() -> tuple[Any, ...]:
    state: tuple[Any, ...] = np.random.get_state()  # type: ignore[assignment]  # noqa: NPY002
    name, keys, *rest = state
    return name, keys.tobytes(), *rest


def _set_numpy_stream(state: tuple[Any, ...]) -> None:
    name, keys, *rest = state
    np.random.set_state((name, np.frombuffer(keys, np.uint32), *rest))  # noqa: NPY002


def _set_torch_stream(state: bytes) -> None:
    torch.set_rng_state(torch.frombuffer(bytearray(state), dtype=torch.uint8))


def _flushes_denormals() -> bool:
    return float(np.float64(5e-324) * np.float64(1.0)) == 0.0


def _set_device(device: torch.device) -> None:
    # Setting the default, the CPU, explicitly would slow every later call of torch.
    torch.set_default_device(None if device.type == "cpu" else device)


def _deterministic() -> tuple[bool, bool]:
    warn = torch.is_deterministic_algorithms_warn_only_enabled()
    return torch.are_deterministic_algorithms_enabled(), warn


def _set_list(place: list[Any], values: list[Any]) -> None:
    place[:] = values


def _set_streams(streams: tuple[Any, Any, Any]) -> None:
    sys.stdin, sys.stdout, sys.stderr = streams


def _set_hooks(hooks: tuple[Any, Any, Any]) -> None:
    sys.excepthook, sys.unraisablehook, threading.excepthook = hooks


def _set_tracing(tracing: tuple[Any, Any]) -> None:
    sys.settrace(tracing[0])
    sys.setprofile(tracing[1])


def _logging() -> tuple[Any, ...]:
    root = logging.getLogger()
    return root.level, logging.root.manager.disable, tuple(root.handlers)


def _set_logging(state: tuple[Any, ...]) -> None:
    root = logging.getLogger()
    root.setLevel(state[0])
    logging.disable(state[1])
    root.handlers[:] = state[2]


PARTS = (
    Part("the current folder", _folder, os.chdir),
    Part("environment variables", lambda: dict(os.environ), _set_environment),
    Part("the umask", _umask, os.umask),
    Part("signal handlers", _signals, _set_signals),
    Part("resource limits", _limits, _set_limits),
    Part(
        "the allowed processor cores",
        lambda: getattr(os, "sched_getaffinity", lambda pid: ())(0),
        lambda cores: getattr(os, "sched_setaffinity", lambda pid, cores: None)(0, cores),
    ),
    Part(
        "the locale",
        lambda: locale.setlocale(locale.LC_ALL),
        lambda value: locale.setlocale(locale.LC_ALL, value),
    ),
    Part("sys.path", lambda: list(sys.path), lambda paths: _set_list(sys.path, paths)),
    Part("the recursion limit", sys.getrecursionlimit, sys.setrecursionlimit),
    Part("the standard streams", lambda: (sys.stdin, sys.stdout, sys.stderr), _set_streams),
    Part(
        "exception hooks",
        lambda: (sys.excepthook, sys.unraisablehook, threading.excepthook),
        _set_hooks,
    ),
    Part("tracing", lambda: (sys.gettrace(), sys.getprofile()), _set_tracing),
    Part("garbage collection", gc.isenabled, lambda on: gc.enable() if on else gc.disable()),
    Part("logging", _logging, _set_logging),
    Part(
        "warnings.showwarning",
        lambda: warnings.showwarning,
        lambda f: setattr(warnings, "showwarning", f),
    ),
    Part(
        "the temporary folder", lambda: tempfile.tempdir, lambda f: setattr(tempfile, "tempdir", f)
    ),
    Part(
        "the start method of processes",
        lambda: multiprocessing.get_start_method(allow_none=True),
        lambda method: multiprocessing.set_start_method(method, force=True),
    ),
    Part("the global random stream of random", random.getstate, random.setstate),
    Part("the global random stream of NumPy", _numpy_stream, _set_numpy_stream),
    Part(
        "the global random stream of torch",
        lambda: torch.get_rng_state().numpy().tobytes(),
        _set_torch_stream,
    ),
    Part("NumPy's error state", lambda: np.geterr(), lambda state: np.seterr(**state)),
    Part("NumPy's error callback", np.geterrcall, np.seterrcall),
    Part(
        "NumPy's print options", np.get_printoptions, lambda options: np.set_printoptions(**options)
    ),
    Part("torch's default dtype", torch.get_default_dtype, torch.set_default_dtype),
    Part("torch's default device", torch.get_default_device, _set_device),
    Part("torch's threads", torch.get_num_threads, torch.set_num_threads),
    Part("torch's gradient mode", torch.is_grad_enabled, torch.set_grad_enabled),
    Part("torch's anomaly mode", torch.is_anomaly_enabled, torch.set_anomaly_enabled),
    Part(
        "torch's deterministic mode",
        _deterministic,
        lambda state: torch.use_deterministic_algorithms(state[0], warn_only=state[1]),
    ),
    Part(
        "torch's matmul precision",
        torch.get_float32_matmul_precision,
        torch.set_float32_matmul_precision,
    ),
    Part(
        "oneDNN in torch",
        lambda: torch.backends.mkldnn.enabled,
        lambda on: torch.backends.mkldnn.set_flags(on),
    ),
    Part("denormal numbers", _flushes_denormals, torch.set_flush_denormal),
)
