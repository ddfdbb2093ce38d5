"""The example notebook, run from its first cell to its last."""

import json
from pathlib import Path

import matplotlib as mpl
import pytest

NOTEBOOK = Path(__file__).parents[1] / "docs" / "explore-results.ipynb"


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_the_notebook_runs_on_results(bench, task, smoke, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mpl.use("agg")
    options = ("--episodes", "3", "--jobs", "1")
    arguments = ("run", "smoke", "--tasks", task.name, *options, "--out", "results/quick")
    assert bench(*arguments)[0] == 0
    names: dict[str, object] = {}
    for cell in json.loads(NOTEBOOK.read_text())["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    assert {"expert", "kodex"} <= set(names["episodes"].method)
    assert names["by_start"].notna().all(axis=None)
