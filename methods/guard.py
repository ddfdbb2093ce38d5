"""Guards the state of the process: it is the same before each method, and restored after it.

A method may change the current folder, torch's default dtype, a random stream or a function of
NumPy. Without a guard, the next job in the same process would compute something else.
"""

import builtins
import json
import math
import os
import random
import shutil
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import BuiltinFunctionType, FunctionType
from typing import Any

import numpy as np
import psutil
import torch
from threadpoolctl import threadpool_limits

from methods.process_state import PARTS
from tasks.data import generator

_SINGLE_THREADED = ("MKL", "NUMBA", "OMP", "OPENBLAS")
_GUARDED = ("bench", "methods", "numpy", "scipy", "tasks")
"""Packages whose functions and classes are restored if a method replaces them."""
_MODULES = (builtins, json, math, os, random, time, torch, torch.linalg, torch.nn.functional)
_CODE = (FunctionType, BuiltinFunctionType, np.ufunc, type, type(np.linalg.solve))
_HELPERS = ("resource_tracker", "forkserver")
"""Child processes that Python itself starts and keeps."""
_GRACE = 3.0
"""Seconds until a child process that was asked to end is killed."""


@contextmanager
def guarded(*stream: str | int) -> Iterator[list[str]]:
    """Runs code in an empty folder, on one thread, with seeded global random streams.

    A copy of the process that the code has forked ends here, and restores nothing.

    Args:
        stream: seeds the global random streams of random, NumPy and torch, so that a method that
            uses them is repeatable. It names what the code computes.

    Yields:
        A list. After the block, it names the parts of the process that the code changed. They are
        restored, except for threads that still run.
    """
    changed: list[str] = []
    me = os.getpid()
    before = [part.read() for part in PARTS]
    functions, children = _functions(), _children()
    threads = set(threading.enumerate())
    scratch = tempfile.mkdtemp(prefix="bench-")
    with warnings.catch_warnings(), threadpool_limits(1):
        _begin(scratch, *stream)
        started, filters = [part.read() for part in PARTS], list(warnings.filters)
        try:
            yield changed
        finally:
            if os.getpid() != me:
                os._exit(0)
            differ = [part.read() != value for part, value in zip(PARTS, started, strict=True)]
            changed += [part.name for part, differs in zip(PARTS, differ, strict=True) if differs]
            changed += ["the warning filters"] * (warnings.filters != filters)
            changed += _put_back(functions)
            changed += _end(_children() - children)
            changed += [f"thread {t.name}" for t in set(threading.enumerate()) - threads]
            for part, value in zip(PARTS, before, strict=True):
                if part.read() != value:
                    part.write(value)
            shutil.rmtree(scratch, ignore_errors=True)


def _begin(scratch: str, *stream: str | int) -> None:
    rng = generator("global streams", *stream)
    random.seed(int(rng.integers(2**32)))
    np.random.seed(int(rng.integers(2**32)))  # noqa: NPY002
    torch.manual_seed(int(rng.integers(2**32)))
    torch.set_num_threads(1)
    os.environ.update(dict.fromkeys((f"{one}_NUM_THREADS" for one in _SINGLE_THREADED), "1"))
    sys.path[:] = [os.path.abspath(path) for path in sys.path]
    os.chdir(scratch)


def _functions() -> dict[Any, dict[str, Any]]:
    """The functions and classes of guarded modules and the suite's classes, by owner and name."""
    modules = {m for name, m in list(sys.modules.items()) if name.partition(".")[0] in _GUARDED}
    owners: list[Any] = [*filter(None, modules.union(_MODULES)), torch.Tensor]
    found = {owner: _code(owner) for owner in owners}
    ours = [v for names in found.values() for v in names.values() if _is_our_class(v)]
    return found | {owner: _code(owner) for owner in ours}


def _code(owner: Any) -> dict[str, Any]:
    # isinstance would make deprecated names of torch warn.
    return {n: v for n, v in list(vars(owner).items()) if issubclass(type(v), _CODE)}


def _is_our_class(value: Any) -> bool:
    return issubclass(type(value), type) and value.__module__.partition(".")[0] in _GUARDED[:2]


def _put_back(functions: dict[Any, dict[str, Any]]) -> list[str]:
    """Restores replaced functions and removes those added to classes; returns their names."""
    changed = []
    for owner, before in functions.items():
        for name, value in before.items():
            if vars(owner).get(name) is not value:
                changed.append(f"{owner.__name__}.{name}")
                setattr(owner, name, value)
        for name in set(_code(owner)) - set(before) if isinstance(owner, type) else ():
            changed.append(f"{owner.__name__}.{name}")
            delattr(owner, name)
    return changed


def _children() -> set[psutil.Process]:
    return set(psutil.Process().children(recursive=True))


def _end(children: set[psutil.Process]) -> list[str]:
    """Ends child processes; returns their names."""
    left = []
    for child in children:
        try:
            if any(helper in " ".join(child.cmdline()) for helper in _HELPERS):
                continue
            left.append((child, f"child process {child.name()}"))
            child.terminate()
        except psutil.NoSuchProcess:
            continue
    _, alive = psutil.wait_procs([child for child, _ in left], timeout=_GRACE)
    for child in alive:
        child.kill()
    return [name for _, name in left]
