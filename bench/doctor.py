"""Checks what this machine has, and what a run would lack."""

import platform
from collections.abc import Callable
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from bench.checking import known
from bench.commands import FAULTS
from bench.cores import cores, total_memory
from bench.guest_tasks import known_task
from bench.plan import GIB_PER_JOB, free_disk
from bench.renderer import renderer
from methods.registry import package_methods, unusable
from tasks.base import Task
from tasks.cache import cache_folder, writable_cache
from tasks.demos import demos_path
from tasks.errors import InputError
from tasks.experts import experts_of, load_expert
from tasks.files import writable_folder
from tasks.packages import unreadable
from tasks.pins import PINNED, UNPINNED, pin, processor
from tasks.registry import EXPERTS, TASKS, get_task, package_tasks, unusable_tasks

PACKAGES = ("mujoco", "torch", "numpy", "scipy", "pandas", "pyarrow", "joblib", "matplotlib")
LEAST_DISK = 15.0
"""GiB of disk that the results of the preset ``paper`` need at ease."""


def examine(folder: Path) -> list[dict[str, Any]]:
    """Returns a row for each check: ``what``, ``found``, and ``advice`` if something is wrong.

    Args:
        folder: the planned results folder.
    """
    return [*_packages(), *_brought(), *_machine(folder), _drawing(), *_experts()]


def _packages() -> list[dict[str, Any]]:
    rows = [{"what": "python", "found": platform.python_version(), "advice": ""}]
    for name in PACKAGES:
        try:
            rows.append({"what": name, "found": version(name), "advice": ""})
        except PackageNotFoundError:
            advice = f"install it: pip install {name}"
            rows.append({"what": name, "found": "missing", "advice": advice})
    return rows


def _brought() -> list[dict[str, Any]]:
    """Methods, tasks and commands of installed packages that cannot be used."""
    faults = {f"method {name!r}": fault for name, fault in unusable().items()}
    for name in package_methods():
        faults[f"method {name!r}"] = _refusal(partial(known, name))
    faults |= {f"task {name!r}": fault for name, fault in unusable_tasks().items()}
    for name in package_tasks():
        faults[f"task {name!r}"] = _refusal(partial(known_task, name))
    faults |= {f"command {name!r}": fault for name, fault in FAULTS.items()}
    faults |= {
        f"package {name!r}": f"its entry points cannot be read ({reason}): uninstall or repair it"
        for name, reason in unreadable().items()
    }
    rows = faults.items()
    return [{"what": what, "found": "unusable", "advice": fault} for what, fault in rows if fault]


def _machine(folder: Path) -> list[dict[str, Any]]:
    memory = total_memory()
    available = cores()
    there, free = free_disk(folder)
    few = memory < GIB_PER_JOB * available
    return [
        *_kernels(),
        {"what": "cores", "found": str(available), "advice": ""},
        {
            "what": "memory",
            "found": f"{memory:.0f} GiB",
            "advice": f"run fewer jobs: bench run --jobs {max(1, int(memory / GIB_PER_JOB))}"
            if few
            else "",
        },
        {
            "what": f"disk at {there}",
            "found": f"{free:.0f} GiB free",
            "advice": _refusal(partial(writable_folder, folder))
            or ("free some: results of the whole paper take about 11 GiB" * (free < LEAST_DISK)),
        },
        _cache(),
    ]


def _kernels() -> list[dict[str, Any]]:
    """The processor and C library, and whether the same bits are computed as elsewhere."""
    why_not, library = pin().why_not, " ".join(platform.libc_ver())
    advice = why_not and f"results may differ in their last bits on other machines: {why_not}"
    return [
        {"what": "processor", "found": processor()[0] or platform.machine(), "advice": ""},
        {"what": "C library", "found": library.strip() or "unknown", "advice": ""},
        {
            "what": "kernels",
            "found": UNPINNED if why_not else f"pinned ({PINNED})",
            "advice": advice,
        },
    ]


def _cache() -> dict[str, Any]:
    try:
        found = str(cache_folder())
    except InputError as error:
        return {"what": "cache", "found": "none", "advice": str(error)}
    return {"what": "cache", "found": found, "advice": _refusal(partial(writable_cache, ""))}


def _refusal(call: Callable[[], object]) -> str:
    """The message of the InputError that a call raises, if any."""
    try:
        call()
    except InputError as error:
        return str(error)
    return ""


def _drawing() -> dict[str, Any]:
    found = renderer()
    advice = "for films, install EGL or OSMesa: libegl1 and libgl1-mesa-dri on Debian"
    return {"what": "renderer", "found": found or "none", "advice": "" if found else advice}


def _experts() -> list[dict[str, Any]]:
    brought = [name for name in package_tasks() if not _refusal(partial(known_task, name))]
    return [_expert(get_task(name)) for name in (*TASKS, *brought)]


def _expert(task: Task) -> dict[str, Any]:
    brought = task.name not in TASKS
    try:
        names = experts_of(task) if brought else EXPERTS
        for name in names:
            load_expert(task, name)
    except InputError as error:
        return {"what": task.name, "found": "no expert", "advice": str(error)}
    if not names:
        return {"what": task.name, "found": "task of a package, without an expert", "advice": ""}
    expert = "task of a package, with an expert" if brought else "experts shipped"
    made = "made" if demos_path(task, 1).exists() else "not made yet"
    return {"what": task.name, "found": f"{expert}, demonstrations {made}", "advice": ""}
