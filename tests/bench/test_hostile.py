"""Misbehaving methods of a package, which must not affect the methods of the suite."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pandas as pd
import psutil
import pytest

from bench.results import Results

PACKAGE = Path(__file__).parents[1] / "hostile"
VICES = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["project"]["entry-points"]
METHODS = [name for name in VICES["bench.methods"] if name != "expert"]
FAILING = {
    "aborts": "killed by SIGABRT",
    "alarms": "killed by SIGALRM",
    "asks": "EOFError",
    "autos": "a field called epochs is a whole number from 1, got 'auto'",
    "both": "it is a MotionMethod and an ActionMethod",
    "empties": "parameters() is empty",
    "enums": "{'kind': <Kind.GOOD: 'good'>} cannot be stored",
    "exits": "SystemExit: 4 (hostile.py:",
    "floods": "killed by SIGABRT",
    "hangs": "it exceeded the limit of",
    "hides": "SecretError: its message cannot be shown (hostile.py:",
    "import_exits": "SystemExit: this module ends the program (hostile_exit.py:3)",
    "import_leaves": "ended with exit code 0 before it returned a result",
    "imports": "No module named 'no_such_module_anywhere' (hostile_import.py:1)",
    "interrupts": "KeyboardInterrupt",
    "kills": "killed by SIGKILL",
    "kinds": "all sizes must have configs of one class, got Config, Wider",
    "lambdas": "cannot be stored",
    "leaves": "ended with exit code 0 before it returned a result",
    "lists": "must return a NumPy array of floats, got list",
    "longs": "holds 'states', numpy.ndarray of float128",
    "masks": "must return a NumPy array of floats, got numpy.ma.MaskedArray",
    "metadata": "names an array '__metadata__'",
    "objects": "numpy.ndarray of object",
    "recurses": "RecursionError",
    "shapes": "shapes on door, seed 1: rollout returned shape",
    "signals": "killed by signal 40",
    "slashes": "a size cannot be called 'w/o'",
    "swells": "takes 4.0 GiB, allowed is 1",
    "tells": "RuntimeError: see above",
    "writes": "wrote to the demonstrations",
}
"""By method, what its failure says; the other methods have results."""


@pytest.fixture(scope="module")
def command(tmp_path_factory):
    """Runs `bench` with the package installed; returns the exit code and the output."""
    place = tmp_path_factory.mktemp("hostile")
    package = shutil.copytree(PACKAGE, place / "package")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*pip, "--target", place / "site", package], check=True, capture_output=True)

    def run(*words):
        done = subprocess.run(
            [sys.executable, "-c", "from bench.cli import main; main()", *map(str, words)],
            env=os.environ | {"PYTHONPATH": str(place / "site")},
            cwd=place,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        return done.returncode, done.stdout

    return run


def study(out, *methods):
    chosen = ("--experiments", "success", "--methods", ",".join(methods), "--out", out)
    return ("run", "smoke", *chosen, "--limit", "0.3")


@pytest.fixture(scope="module")
def clean(command, tmp_path_factory):
    out = tmp_path_factory.mktemp("clean") / "results"
    assert command(*study(out, "kodex", "nn"), "--jobs", "2")[0] == 0
    return out


ORPHAN = ["sleep", "3607"]
OF_EACH_KIND = (
    *("exits", "hangs", "import_leaves", "interrupts", "kills", "leaves", "nans", "orphans"),
    *("patches", "shapes", "swells", "tells", "writes"),
)
PLACES = (("loky", 2), ("loky", 1), ("dask", 2))


@pytest.mark.parametrize(
    ("backend", "jobs", "methods"),
    [
        (*PLACES[0], OF_EACH_KIND),
        *(pytest.param(*place, METHODS, marks=pytest.mark.long) for place in PLACES),
    ],
    ids=["of each kind", *("-".join(map(str, place)) for place in PLACES)],
)
def test_a_misbehaving_method_does_not_affect_others(
    command, clean, tmp_path, backend, jobs, methods, files_of
):
    out = Path("results", backend, str(jobs), str(len(methods)))
    code, said = command(*study(out, "kodex", "nn", *methods), "--jobs", jobs, "--backend", backend)
    assert code == 3, said
    out = next(Path(clean.parents[1]).glob(f"hostile*/{out}"))
    beside, alone = files_of(out), files_of(clean)
    assert alone.items() <= beside.items()
    reasons = {one["label"]: one["reason"] for one in Results(out).failures()}
    rows = Results(out).frame().query("split == 'test'").set_index("method")
    for method in methods:
        found = [text for label, text in reasons.items() if method in label.split("-")]
        if method in FAILING:
            assert FAILING[method] in " ".join(found), method
            assert method not in rows.index
        else:
            assert found == [], method
            assert rows.episodes[method] == 20, method
    assert rows.diverged["nans"] == 20
    (tells,) = [one for one in Results(out).failures() if "tells" in one["label"]]
    assert "there is no licence file" in tells["traceback"]
    assert not [p for p in psutil.process_iter(["cmdline"]) if p.info["cmdline"] == ORPHAN]
    assert "failed (" in command("status", out)[1]
    assert command("report", out)[0] == 0
    table = pd.read_csv(out / "report/tables/success.csv").set_index("row")
    assert set(table.index) == {"kodex", "nn", *methods} - {*FAILING}


def test_check_survives_misbehaving_methods(command):
    code, said = command("check", "leaves")
    assert (code, said.count("BROKEN")) == (3, 1)
    assert "exit code 0" in said
    code, said = command("check", "derived")
    assert (code, "21 of 21 rules hold" in said) == (0, True), said


def test_a_setting_of_a_method_that_cannot_be_used_stops_no_other(command):
    chosen = ("--methods", "kodex,import_leaves", "--set", "import_leaves.x=3", "--out", "planned")
    code, said = command("plan", "smoke", *chosen)
    assert code == 0, said
    assert "exit code 0 before it returned a result; it is left out" in said
    assert "missing: " in said


@pytest.mark.parametrize(
    ("word", "name", "reason"),
    [
        ("describe", "import_leaves", "exit code 0"),
        ("check", "imports", "hostile_import.py:1"),
        ("check", "expert", "a method cannot be called 'expert'"),
    ],
)
def test_a_method_that_cannot_be_used_is_refused_with_its_reason(command, word, name, reason):
    code, said = command(word, name)
    assert code == 2
    assert reason in said
