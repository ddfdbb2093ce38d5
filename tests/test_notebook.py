"""The example notebook, run from its first cell to its last, in its own folder."""

import json
import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
NOTEBOOK = DOCS / "explore-results.ipynb"
run_notebook = runpy.run_path(str(DOCS / "run_notebook.py"))["run_notebook"]


def shown(text: str) -> list[list[tuple[str, list[str]]]]:
    """The kinds of output of each cell, and its tables; pictures differ between machines."""
    cells = json.loads(text)["cells"]
    return [
        [
            (kind, data if kind == "text/html" else [])
            for output in cell.get("outputs", [])
            for kind, data in output["data"].items()
        ]
        for cell in cells
    ]


def test_the_notebook_shows_its_stored_outputs_for_the_shipped_results():
    text = NOTEBOOK.read_text()
    again, names = run_notebook(NOTEBOOK)
    assert shown(again) == shown(text)
    assert names["rates"].loc["kodex", "door"] == pytest.approx(91.4, abs=0.05)
    assert sum(kind == "image/png" for cell in shown(text) for kind, _ in cell) == 3
    assert len(text) < 300_000


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_the_notebook_runs_on_other_results(bench, task, smoke, tmp_path):
    options = ("--tasks", task.name, "--episodes", "3", "--jobs", "1")
    assert bench("run", "smoke", *options, "--out", str(tmp_path / "results/quick"))[0] == 0
    text = NOTEBOOK.read_text()
    assert text.count("bench.open()") == 1
    (tmp_path / "docs").mkdir()
    copy = tmp_path / "docs" / NOTEBOOK.name
    copy.write_text(text.replace("bench.open()", "bench.open('../results/quick')"))
    _, names = run_notebook(copy)
    assert set(names["rates"].index) == {"expert", "kodex"}
    assert len(names["hard"]) == 3
