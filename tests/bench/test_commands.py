"""Commands of packages, which are folders on the path of a separate process."""

import os
import subprocess
import sys

import pytest

WORKS = "def hello():\n    print('hello')\n"
BROKEN = {
    "an exit": ("raise SystemExit(7)", "SystemExit: 7 (evil.py:1)"),
    "a missing module": ("import nowhere", "No module named 'nowhere' (evil.py:1)"),
    "no such name": ("", "has no attribute 'hello'"),
    "no function": ("hello = 3", "TypeError"),
    "no command line": ("def hello(x: 'nowhere'): pass", "NameError"),
}


@pytest.fixture
def run(tmp_path):
    """Runs `bench` with packages, given by name with their command and module."""

    def call(packages, *words):
        for package, (command, text) in packages.items():
            noted = tmp_path / f"{package}-1.0.dist-info"
            noted.mkdir(exist_ok=True)
            about = f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n"
            (noted / "METADATA").write_text(about)
            points = f"[bench.commands]\n{command} = {package}:hello\n"
            (noted / "entry_points.txt").write_text(points)
            (tmp_path / f"{package}.py").write_text(text)
        path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
        code = "from bench.cli import main; main()"
        done = subprocess.run(
            [sys.executable, "-c", code, *words],
            env=os.environ | {"PYTHONPATH": path},
            capture_output=True,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout, done.stderr

    return call


def test_a_command_of_a_package_runs(run):
    assert run({"good": ("hello", WORKS)}, "hello") == (0, "hello\n", "")


def test_ctrl_c_while_commands_of_packages_are_imported_ends_the_program(run):
    code, _, error = run({"slow": ("hello", "raise KeyboardInterrupt")}, "list")
    assert code != 0
    assert "cannot be imported" not in error


@pytest.mark.parametrize(("text", "reason"), BROKEN.values(), ids=BROKEN)
def test_a_broken_command_fails_alone_and_says_why(run, text, reason):
    packages = {"evil": ("evil", text)}
    assert run(packages, "list")[0] == 0
    code, said, error = run(packages, "evil", "--any", "word")
    assert (code, said) == (2, "")
    assert error.startswith("bench: command 'evil' of evil cannot be imported: ")
    assert reason in error
    assert error.count("\n") == 1


def test_two_packages_with_one_command_are_both_named(run):
    packages = {"first": ("hello", WORKS), "second": ("hello", WORKS)}
    code, _, error = run(packages, "hello")
    assert code == 2
    assert "first and second provide the same command 'hello'" in error


def test_a_package_does_not_replace_a_command_of_the_suite(run):
    packages = {"evil": ("list", WORKS), "other": ("pack", WORKS)}
    assert "kodex" in run(packages, "list")[1]
    assert "evil provides a command 'list', which bench has" in run(packages, "doctor")[1]
    assert "kodex-bench and other provide the same command" in run(packages, "pack")[2]
