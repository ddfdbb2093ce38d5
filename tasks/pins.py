"""Choose the kernels of numerical libraries, so that every x86-64 processor computes the same bits.

OpenBLAS, MKL, oneDNN, torch and NumPy look at the processor when they are loaded, and choose their
kernels by it. Kernels round differently. `pin` sets the environment variables that choose for them:
kernels that every processor with AVX2 and FMA has. It must come before NumPy and torch are loaded,
so each package of the suite calls it first. Processes inherit it from those that start them.
"""

import os
import platform
import re
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tasks.errors import InputError, unknown_name

PINS = {
    "OPENBLAS_CORETYPE": "Haswell",
    # Not enough for processors of different vendors: the suite's products go through OpenBLAS
    # (tasks.product), and only methods of packages have MKL's.
    "MKL_CBWR": "COMPATIBLE",
    "ATEN_CPU_CAPABILITY": "avx2",
    "ONEDNN_MAX_CPU_ISA": "AVX2",
    "NPY_ENABLE_CPU_FEATURES": "X86_V3",
}
"""Environment variables, each with the value that every process gets."""
SWITCH = "BENCH_PINS"
"""Environment variable that switches pinning on, as it is by default, or off."""
ON, OFF = ("on", "1", "yes", "true"), ("off", "0", "no", "false")
"""Its values; an empty one is as none."""
MARKS = PINNED, UNPINNED = "x86-64-v3", "unpinned"
"""The marks of results. They are part of every key, so that the two are never mixed."""
NEEDED = ("avx2", "fma", "bmi1", "bmi2", "f16c", "movbe", "abm")
"""What a processor must have, as /proc/cpuinfo calls it."""

_LIBRARIES = ("numpy", "torch")
_MASKS = {"-AVX", "-AVX2", "-FMA"}
"""Names in GLIBC_TUNABLES that give functions such as exp another rounding."""


@dataclass(frozen=True)
class State:
    """Whether kernels are pinned."""

    why_not: str
    """The reason why they are not; empty if they are."""
    late: bool
    """Whether NumPy or torch was loaded before. Only processes started from here are then pinned,
    and not this one."""


@cache
def pin() -> State:
    """Sets the variables, unless that cannot be; the first call does it."""
    reason = why_not()
    late = not _set() and any(name in sys.modules for name in _LIBRARIES)
    if not reason:
        os.environ.update(PINS)
    return State(reason, late and not reason)


def mark() -> str:
    """Returns the mark of what processes compute that this one starts."""
    return UNPINNED if pin().why_not else PINNED


def check_environment() -> None:
    """Checks that a process started now gets the mark of this one.

    Raises:
        InputError: the environment has changed since this process chose its kernels, or `SWITCH`
            has an unknown value.
    """
    if _switch() not in (*ON, *OFF):
        raise unknown_name(f"value of {SWITCH}", os.environ[SWITCH], (*ON, *OFF))
    then, now = pin().why_not, why_not()
    lost = [] if then else [name for name in PINS if not os.environ.get(name)]
    if now != then or lost:
        found = now or (f"{', '.join(lost)} is no longer set" if lost else f"no longer: {then}")
        raise InputError(
            "kernels were chosen when kodex-bench was imported, and the environment has changed"
            f" since ({found}): set environment variables before the import"
        )


def check_early() -> None:
    """Raises InputError if this process has other kernels than those that it starts."""
    if pin().late:
        raise InputError(
            "NumPy or torch was loaded before kodex-bench, and chose its kernels by the processor:"
            " import bench first, or use another backend than sequential"
        )


def check_mark(expected: str) -> None:
    """Raises InputError unless this very process computes what has that mark."""
    check_early()
    if mark() != expected:
        here = pin().why_not or "kernels are pinned"
        raise InputError(f"results marked {expected} cannot be computed here: {here}")


def _set() -> bool:
    return PINS.items() <= os.environ.items()


def _switch() -> str:
    return os.environ.get(SWITCH, "").strip().lower() or ON[0]


def why_not() -> str:
    """Returns why kernels cannot be pinned here, or an empty text."""
    if _switch() in OFF:
        return f"{SWITCH} switches it off"
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return "only x86-64 processors under Linux are pinned"
    lacking = [name for name in NEEDED if name not in processor()[1]]
    if lacking:
        return f"this processor lacks {', '.join(lacking)}"
    for name, value in PINS.items():
        if (os.environ.get(name) or value) != value:
            return f"{name} is {os.environ[name]}, not {value}: unset it"
    if os.environ.get("NPY_DISABLE_CPU_FEATURES"):
        return "NPY_DISABLE_CPU_FEATURES is set: unset it"
    tunables = re.split("[=,:]", os.environ.get("GLIBC_TUNABLES", "").upper())
    if _MASKS & {name.removesuffix("_USABLE") for name in tunables}:
        return "GLIBC_TUNABLES takes AVX2 or FMA from glibc: unset it"
    return ""


@cache
def processor() -> tuple[str, frozenset[str]]:
    """Returns the name of the processor and its features; nothing of both where it is unknown."""
    facts: dict[str, str] = {}
    try:
        with Path("/proc/cpuinfo").open() as file:
            for line in file:
                name, _, value = line.partition(":")
                facts.setdefault(name.strip(), value.strip())
                if {"model name", "flags"} <= {*facts}:
                    break
    except OSError:
        pass
    return facts.get("model name", ""), frozenset(facts.get("flags", "").split())
