"""Runs the pages on Python and on own demonstrations, and a section on methods."""

import re
import shlex
import sys
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure

from bench.results import Results

DOCS = Path(__file__).parents[1] / "docs"
BLOCK = re.compile(r"(?:<!-- file: (\S+) -->\n\n)?```(python|sh)\n(.*?)```", re.DOTALL)


@pytest.fixture
def run_page(bench, smoke, tmp_path, monkeypatch):
    """Runs the blocks of a page, or of a section, in one folder; returns their name space."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BENCH_JOBS", "1")
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr("bench.recording.apart", lambda job, *arguments: job(*arguments))

    def run(name, section=""):
        names, text = {}, (DOCS / name).read_text()
        text = text.split(f"\n## {section}\n")[1].split("\n## ")[0] if section else text
        for file, language, code in BLOCK.findall(text):
            if file:
                Path(file).write_text(code)
            elif language == "python":
                exec(compile(code, name, "exec"), names)
            else:
                for line in code.splitlines():
                    code, _, error = bench(*shlex.split(line)[1:])
                    assert code == 0, (line, error)
        return names

    return run


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_the_page_on_python_runs(task, run_page, monkeypatch):
    views = {
        "failures": lambda *place, split, seed: pd.DataFrame({"start": [0, 3]}),
        "motions": lambda *place, seed: pd.DataFrame(),
        "draw_motion": lambda frame, joints: Figure(),
    }
    monkeypatch.setattr("bench.opened.view", views.get)
    names = run_page("python.md")
    assert set(names["results"].frame.method) == {"kodex", "nn"}
    assert names["error"] >= 0
    assert names["found"].drift == 0
    assert Path("kodex-17.png").exists()


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_the_page_on_own_demonstrations_runs_up_to_a_table_row(task, run_page):
    run_page("own_demos.md")
    frame = Results(Path("results/mine")).frame()
    assert set(frame.method) == {"kodex"}
    assert "the demonstrations of nearest.safetensors" in Results(Path("results/mine")).notes()[0]
    assert "kodex" in Path("results/mine/report/tables/success.csv").read_text()


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_the_section_on_a_policy_trained_elsewhere_runs_up_to_a_table_row(task, paper, run_page):
    run_page("add_a_method.md", "A policy trained elsewhere")
    assert set(Results(Path("results/given")).frame().method) == {"nn", "kodex"}
    rows = Path("results/given/report/tables/success.md").read_text()
    assert "| NN weights from file |" in rows
    assert "| KODex " in rows
