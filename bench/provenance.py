"""When, where and with which software a result was made. It is stored, but not part of keys."""

import platform
import time
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from bench.cores import cores
from bench.package_source import code_of
from tasks.pins import PINNED, mark, processor

LIBRARIES = ("kodex-bench", "mujoco", "numpy", "scipy", "torch")


def provenance(seconds: float, *names: str) -> dict[str, Any]:
    """Returns the facts about a result.

    Args:
        seconds: CPU seconds that it took.
        names: see `software`.
    """
    name, _ = processor()
    return {
        "seconds": round(seconds, 3),
        "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "host": {"platform": platform.platform(), "cores": cores(), "processor": name},
        **software(*names),
    }


def software(*names: str) -> dict[str, Any]:
    """Returns what decides about bits besides a key: ``pins``, ``c_library`` and ``versions``.

    Args:
        names: of methods and tasks. For those of packages there is also ``code``, see
            `bench.package_source.code_of`.
    """
    code = code_of(*names)
    return {
        "pins": mark(),
        "c_library": " ".join(platform.libc_ver()),
        "versions": {"python": platform.python_version()} | {n: version(n) for n in LIBRARIES},
        **({"code": code} if code else {}),
    }


def same_bits(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether what two sets of facts belong to must have the same bits, given the same key."""
    names = ("pins", "c_library", "versions")
    alike = all(one.get(name) == other.get(name) for name in names)
    return alike and one.get("pins") == PINNED
