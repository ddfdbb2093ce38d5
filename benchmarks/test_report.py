"""A report whose figures are drawn in two processes, against one that draws them one by one."""

import subprocess
import sys
from os import environ
from pathlib import Path

BENCH = Path(sys.executable).with_name("bench")


def test_report(compare, tmp_path):
    """As users call it, with the start of the command and of the processes that draw."""

    def write(jobs: str) -> None:
        report = [BENCH, "report", "--reference", "--out", tmp_path]
        subprocess.run(report, env=environ | {"BENCH_JOBS": jobs}, capture_output=True, check=True)

    compare("report", ours=lambda: write("2"), peer=lambda: write("1"), target=1.2)
