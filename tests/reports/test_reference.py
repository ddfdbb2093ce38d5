"""The shipped results, and the tables of them in documents."""

import re
import subprocess
import sys
from os import environ
from pathlib import Path

import pandas as pd
import pytest

import bench
from bench.packed import SHIPPED
from bench.selection import SIZES
from methods.registry import get_method
from reports.exhibits import EXHIBITS
from tasks.registry import TASKS

ROOT = Path(__file__).parents[2]
REPORT = """
import sys
from bench.cli import main
sys.argv = ["bench", "report", "--reference", "--out", sys.argv[1]]
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
sys.exit("torch" in sys.modules)
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """Returns the folder of a report on the shipped results, made without torch.

    Its figures are drawn in two processes.
    """
    folder = tmp_path_factory.mktemp("reference")
    made = subprocess.run(
        [sys.executable, "-c", REPORT, folder],
        env=environ | {"BENCH_JOBS": "2"},
        capture_output=True,
        text=True,
    )
    assert made.returncode == 0, made.stderr
    return folder


def test_shipped_results_are_smaller_than_10_mib():
    assert sum(path.stat().st_size for path in SHIPPED.iterdir()) < 10 * 2**20


def test_report_of_the_shipped_results_has_every_method(report):
    assert set(pd.read_csv(report / "tables/success.csv").row) >= {"expert", "kodex", "nn", "ngf"}
    assert "Reduced protocol" not in (report / "index.html").read_text()


def test_report_has_each_figure_in_each_format(report):
    figures = {path.stem for path in report.glob("figures/*.png")}
    tables = {path.stem for path in report.glob("tables/*.csv")}
    assert figures == {exhibit.name for exhibit in EXHIBITS if exhibit.axis} & tables
    for ending in ("pdf", "svg"):
        assert {path.stem for path in report.glob(f"figures/*.{ending}")} == figures
    assert all(path.stat().st_size for path in report.glob("figures/*"))


def test_efficiency_shows_every_method_on_each_of_its_tasks(report):
    table = pd.read_csv(report / "tables/efficiency.csv")
    learnt = {*pd.read_csv(report / "tables/success.csv").row} - {"expert"}
    assert {*table.column} == {*TASKS}
    for task, rows in table.groupby("column"):
        assert {*rows.method} == learnt, task


def test_every_claim_has_a_verdict_on_the_shipped_results(report):
    assert not set(pd.read_csv(report / "tables/claims.csv").ours) & {"not run", "failed"}


@pytest.mark.parametrize("page", ["README.md", "docs/results.md", "docs/beyond_the_paper.md"])
def test_tables_in_documents_equal_those_of_the_report(report, page):
    text = (ROOT / page).read_text()
    marked = re.findall(r"<!-- (\w+) -->\n\n((?:\|.*\n)+)(?:\n|\Z)", text)
    assert len(marked) == text.count("<!-- ") > 0
    for name, table in marked:
        assert table.strip() in (report / f"tables/{name}.md").read_text(), name


@pytest.mark.parametrize("method", ["nn", "lstm", "ndp", "ngf"])
def test_default_size_is_the_smallest_whose_worst_seed_is_near_the_best_size(method):
    found = bench.open().frame.query(
        "variant == 'described' and split == 'validation' and demos == 200 and method == @method"
    )
    if found.empty:
        pytest.skip("the shipped results lack the experiment sizes")
    sizes = (100 * found.successes / found.episodes).groupby([found.task, found["size"]])
    mean, worst = sizes.mean(), sizes.min()
    for task, default in get_method(method).default_size.items():
        near = [size for size in SIZES if worst[task][size] >= mean[task].max() - 10]
        assert default == near[0], task
