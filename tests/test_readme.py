import re
import shlex
import sys
from pathlib import Path

import pytest

from bench.cli import main

README = (Path(__file__).parents[1] / "README.md").read_text()
BENCH = ".venv/bin/bench "


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


@pytest.mark.parametrize("code", blocks("python"))
def test_python_in_the_readme_runs(code):
    exec(compile(code, "README.md", "exec"), {})


commands = [line for block in blocks("sh") for line in block.splitlines() if line.startswith(BENCH)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("readme")


@pytest.mark.parametrize("command", commands)
def test_commands_in_the_readme_run(command, monkeypatch, folder):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "argv", ["bench", *shlex.split(command.removeprefix(BENCH))])
    with pytest.raises(SystemExit) as stop:
        main()
    assert not stop.value.code
