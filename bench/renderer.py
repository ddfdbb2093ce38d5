"""Whether MuJoCo can draw on this machine, and how.

It reads MUJOCO_GL when it is imported, so that this module does not import it.
"""

import os
import subprocess
import sys

RENDERERS = ("egl", "osmesa")
_DRAW = """
import mujoco
mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 8, 8).close()
"""


def renderer() -> str | None:
    """Returns the value of MUJOCO_GL with which MuJoCo can draw here, or None.

    Where one is set already, no other is tried. A child process tries, since what is amiss with a
    driver may well end it.
    """
    chosen = os.environ.get("MUJOCO_GL")
    for name in (chosen,) if chosen else RENDERERS:
        tried = subprocess.run(
            [sys.executable, "-c", _DRAW],
            env=os.environ | {"MUJOCO_GL": name},
            capture_output=True,
            check=False,
        )
        if tried.returncode == 0:
            return name
    return None
