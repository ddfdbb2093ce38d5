"""Finds out whether and how MuJoCo can draw on this machine.

MuJoCo reads MUJOCO_GL when it is imported, so this module does not import it.
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

    If MUJOCO_GL is set, only its value is tried. A child process tries, since a faulty driver may
    crash it.
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
