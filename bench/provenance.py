"""When, where and with which versions a result was made. It is stored, but not part of keys."""

import platform
import time
from importlib.metadata import version
from typing import Any

from bench.cores import cores

LIBRARIES = ("kodex-bench", "mujoco", "numpy", "scipy", "torch")


def provenance(seconds: float) -> dict[str, Any]:
    """Returns the facts about a result, including the CPU seconds that it took."""
    return {
        "seconds": round(seconds, 3),
        "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "host": {"platform": platform.platform(), "cores": cores()},
        "versions": {"python": platform.python_version()} | {n: version(n) for n in LIBRARIES},
    }
