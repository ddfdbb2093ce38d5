"""Links, commands, options, messages and API pages in the documents exist."""

import os
import re
import subprocess
import sys
from itertools import takewhile
from pathlib import Path

import pandas as pd
import pytest

from bench.presets import PRESETS
from bench.source import episodes_table
from methods import checks as method_checks
from tasks import checks as task_checks

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
SOURCE = re.sub(
    r'"\s*f?"',
    "",
    "".join(
        path.read_text()
        for folder in ("bench", "methods", "reports", "tasks")
        for path in (ROOT / folder).glob("*.py")
    ),
)
"""The code, with strings of consecutive lines joined."""


class Nothing:
    """Results without an evaluation."""

    def frame(self):
        return pd.DataFrame()


def commands():
    """Returns every `bench` command in a shell block of any page, as its words."""
    found = set()
    for page in PAGES:
        for block in re.findall(r"```sh\n(.*?)```", page.read_text(), flags=re.DOTALL):
            for line in block.replace("\\\n", " ").splitlines():
                words = line.split("#")[0].removeprefix(".venv/bin/").split()
                if words[:1] == ["bench"]:
                    found.add(tuple(words[1:]))
    return sorted(found)


def prose(page):
    """The text of a page without its blocks of code."""
    return re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)


def headings(page):
    """The headings of a page, as GitHub writes them in links."""
    titles = re.findall(r"^#+ (.*)$", prose(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_have_targets(page):
    links = re.findall(r"\]\((?!http)([^)#]*)#?([^)]*)\)", prose(page))
    for name, heading in links:
        target = page.parent / name if name else page
        assert target.exists(), name
        assert not heading or heading in headings(target), f"{name}#{heading}"


@pytest.mark.parametrize("words", commands(), ids=" ".join)
def test_commands_and_their_options_exist(bench, words):
    names = list(takewhile(lambda word: re.fullmatch("[a-z-]+", word), words))
    path = names[: 2 if names[0] in ("expert", "demos") else 1]
    code, said, error = bench(*path, "--help")
    assert (code, error) == (0, "")
    options = [word.split("=")[0] for word in words if word.startswith("--")]
    assert [option for option in options if option not in said] == []


def test_messages_explained_in_the_documents_are_in_the_code():
    rows = re.findall(r"^\| `(.*?)` \|", (ROOT / "docs/troubleshooting.md").read_text(), re.M)
    parts = [part.strip() for row in rows for part in row.split("...") if part.strip()]
    assert len(parts) > 8
    assert [part for part in parts if part not in SOURCE] == []


def test_documents_install_extras_from_a_clone():
    """The package is not on a package index."""
    assert not [page.name for page in PAGES if "kodex-bench[" in page.read_text()]
    assert "kodex-bench[" not in SOURCE


def test_the_documents_list_the_columns_of_episodes():
    text = (ROOT / "docs/results_format.md").read_text()
    listed = re.findall("`([a-z_]+)`", re.search(r"^Columns: (.*?)\.", text, re.M | re.S)[1])
    assert listed == list(episodes_table(Nothing()).columns)


def test_the_api_pages_can_be_built(tmp_path):
    environment = os.environ | {"MUJOCO_GL": "disable", "PDOC_ALLOW_EXEC": "1"}
    modules = ["bench.results", "methods.dmp", "reports.exhibits.robustness", "tasks.door"]
    command = [sys.executable, "-m", "pdoc", "-d", "google", "-o", str(tmp_path), *modules]
    subprocess.run(command, env=environment, check=True, capture_output=True)
    assert "A DMP layer" in (tmp_path / "methods/dmp.html").read_text()


def runs():
    """Returns each `bench run` of a preset of the suite in any page, with its experiments."""
    text = " ".join(page.read_text().replace("\\\n", " ") for page in PAGES)
    found = re.findall(
        r"bench run ([a-z]+)\b([^`#\n]*)", re.sub(r"(?<=[^\s`])\n(?=[a-z-])", " ", text)
    )
    chosen = [(preset, re.search(r"--experiments ([a-z_,]+)", rest)) for preset, rest in found]
    return sorted({(preset, names[1]) for preset, names in chosen if names and preset in PRESETS})


@pytest.mark.parametrize(("preset", "names"), runs())
def test_presets_have_the_experiments_that_pages_ask_for(preset, names):
    assert {*names.split(",")} <= {*PRESETS[preset].episodes}


@pytest.mark.parametrize(
    ("page", "rules"), [("add_a_method", method_checks.RULES), ("add_a_task", task_checks.RULES)]
)
def test_the_documents_list_every_rule(page, rules):
    text = (ROOT / f"docs/{page}.md").read_text().split("## The rules\n")[1].split("\n## ")[0]
    assert re.findall(r"^\| `(\w+)` \|", text, re.M) == [*rules, "survives_another_process"]
