import subprocess
import sys

from importlinter.cli import lint_imports


def test_imports_point_from_reports_to_tasks(capsys):
    assert lint_imports() == 0, capsys.readouterr().out


def test_reading_results_needs_neither_mujoco_nor_torch():
    code = "import sys, reports.write, bench.results; print({'mujoco', 'torch'} & set(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "set()\n"
