"""The same bits on another processor: QEMU's, which rounds in software and is one of Intel's."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tasks.pins import State, pin

PROGRAM = Path(__file__).parents[1] / "helpers/few_bits.py"
EMULATOR = shutil.which("qemu-x86_64")

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(bool(pin().why_not), reason=f"not pinned: {pin().why_not}"),
    pytest.mark.skipif(not EMULATOR, reason="needs qemu-x86_64 (Debian: qemu-user)"),
]


def digests(*before: str) -> list[str]:
    """Returns the lines of the program, run behind some words."""
    done = subprocess.run([*before, sys.executable, PROGRAM], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.timeout(3600)
def test_an_emulated_processor_of_intel_computes_the_same_bits():
    here = digests()
    assert here[0] == str(State(why_not="", late=False))
    assert digests(EMULATOR, "-cpu", "Haswell", "-0", sys.executable) == here
