"""A task of a package: from `bench new-task` to a film, what it may lack, and faulty ones."""

import importlib
import json
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from safetensors.numpy import load_file

from bench import guest_tasks
from bench.backend import Workers
from bench.new_package import write_package
from bench.presets import PRESETS
from bench.renderer import renderer
from bench.results import Results
from bench.studies import study_of
from tasks import expert_training, registry
from tasks.checks import RULES
from tasks.errors import InputError
from tasks.experts import Expert, evaluate
from tasks.packages import PackageError
from tasks.registry import TASKS, get_task, task_names, unusable_tasks

PAGE = (Path(__file__).parents[2] / "docs/add_a_task.md").read_text()
BLOCK = re.compile(r"(?:<!-- file: (\S+) -->\n\n)?```(\w*)\n(.*?)```", re.DOTALL)
PIP = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A folder of installed packages; runs of a single job are in this process."""

    def in_this_process(jobs, backend="loky", *options):
        return Workers(jobs, "sequential", *options)

    monkeypatch.setattr("bench.backend.Workers", in_this_process)
    monkeypatch.setenv("BENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("BENCH_JOBS", "1")
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    known = set(sys.modules)
    yield tmp_path / "site"
    forget()
    for name in {"press", "mine"} & (set(sys.modules) - known):
        del sys.modules[name]


def forget():
    """Makes this process read the installed packages anew."""
    importlib.invalidate_caches()
    registry._of_package.cache_clear()
    guest_tasks._try.cache_clear()


@pytest.fixture
def install(site):
    """Installs the task `mine`, derived from the one that `bench new-task` writes, without pip."""

    def write(body="    pass\n", value="mine:Mine", name="mine", before=""):
        write_package("tasks.template", "press", site / "source")
        shutil.copytree(site / "source/press", site / "press")
        noted = site / "mine-1.0.dist-info"
        noted.mkdir()
        (noted / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
        (noted / "entry_points.txt").write_text(f"[bench.tasks]\n{name} = {value}\n")
        head = f'{before}\nfrom press import Press\n\nclass Mine(Press):\n    name = "{name}"\n'
        (site / "mine.py").write_text(head + body)
        forget()

    return write


@pytest.fixture
def follow(site, bench):
    """Runs a shell line of the page; returns what it prints."""

    def run(line):
        program, *words = shlex.split(line)
        if program == "pip":
            copy = shutil.copytree(words[-1], site.parent / "packages" / words[-1])
            subprocess.run([*PIP, "--target", str(site), str(copy)], check=True)
            forget()
            return ""
        code, said, error = bench(*words)
        assert code == 0, said + error
        return said

    return run


def test_the_page_on_tasks_runs_from_new_task_to_a_film(follow, monkeypatch):
    monkeypatch.setattr("reports.video.STILL", 1)
    monkeypatch.setattr("reports.video.SIZE", 64)
    printed = ""
    for file, language, code in BLOCK.findall(PAGE):
        if file:
            Path(file).write_text(code)
        elif language == "sh":
            for line in code.splitlines():
                if not line.startswith("bench video") or renderer():
                    printed += follow(line)
        elif language == "python":
            written = {}
            exec(compile(code, "add_a_task.md", "exec"), written)
            if "Quick" in written:
                for rule in RULES:
                    RULES[rule](written["Quick"])
            elif "Learnt" in written:
                trains_and_demonstrates(written["Learnt"](), monkeypatch)
            elif "test_it_keeps_the_contract" in written:
                written["test_it_keeps_the_contract"]("declared")
        else:
            shown = code.splitlines()
    first, *others = (line for line in shown)
    assert first.split(",")[0] in printed
    assert all(line in printed for line in others)
    table = Results(Path("results/press")).frame()
    assert set(table.method) == {"kodex", "nearest", "expert"}
    assert set(table.task) == {"press"}
    expert = table[table.method == "expert"]
    assert (expert.successes == expert.episodes).all()
    assert Path("results/press/report/index.html").exists()
    assert [*Path("results/press/videos").iterdir()] or not renderer()
    mine = Results(Path("results/mine")).frame()
    assert mine[mine.method == "nearest"].demos_key.nunique() == 1


def trains_and_demonstrates(task, monkeypatch):
    """Trains the expert of the page for an iteration, and reads its weights as the page does."""
    small = replace(task.recipe, steps=4 * task.steps, episodes=4, minibatches=2)
    monkeypatch.setattr(type(task), "recipe", small)
    monkeypatch.setattr(expert_training, "CARD_EPISODES", 4)
    expert_training.train(task, Path("training"), lambda row: None, threads=1)
    card = expert_training.write_expert(task, Path("training"))
    assert card.name == "press.json"
    expert = Expert(load_file(card.with_suffix(".safetensors")))
    assert set(evaluate(task, expert, "probe", 2)) == {"successes", "diverged"}


def test_a_task_of_a_package_joins_only_when_it_is_named(install):
    install()
    assert task_names() == [*TASKS, "mine"]
    assert {task for preset in PRESETS.values() for task in preset.tasks} == set(TASKS)
    assert study_of("smoke", tasks="mine").tasks == ("mine",)


def test_check_task_names_the_broken_rule_and_what_it_asks(install, bench):
    install("    def place(self, batch, values):\n        pass\n")
    code, said, _ = bench("check-task", "mine")
    assert code == 3
    assert said.startswith("mine: 14 of 15 rules hold, ")
    assert "BROKEN starts_show_in_the_state: another button_x gives the same first state" in said
    assert "the rule: Each number of a start changes the first state" in said


def test_check_task_reports_a_process_that_ends(install, bench):
    install("    def place(self, batch, values):\n        import os\n        os._exit(4)\n")
    code, said, _ = bench("check-task", "mine")
    assert code == 3
    assert "BROKEN ends: its process ended with exit code 4" in said


NO_EXPERT = "    def expert(self):\n        return None\n"


def test_a_task_without_an_expert_asks_for_demonstrations(install, bench):
    install(NO_EXPERT)
    code, _, error = bench("run", "smoke", "--tasks", "mine", "--out", "out")
    assert code == 2
    assert "task 'mine' has no expert: give demonstrations with --demos FILE" in error
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (
            ("run", "paper", "--experiments", "robustness"),
            "'mine' defines no `changes`: choose other",
        ),
        (("run", "beyond", "--experiments", "closed_loop"), "'mine' defines no `changes`"),
        (("expert", "train"), "no expert of 'mine' can be trained: its class defines no `recipe`"),
        (("demos", "export"), "no Minari format is known for 'mine': its class defines no"),
    ],
)
def test_what_needs_an_optional_part_says_that_it_is_missing(install, bench, words, reason):
    install()
    if words[0] == "run":
        words = (*words, "--tasks", "mine", "--methods", "kodex", "--out", "out")
    else:
        words = (*words, "mine", *(("set",) if words[0] == "demos" else ()))
    code, _, error = bench(*words)
    assert code == 2
    assert reason in error


@pytest.mark.parametrize("name", ["door", "expert", "random"])
def test_a_package_cannot_take_a_name_that_is_in_use(install, bench, name):
    install(name=name)
    assert task_names() == list(TASKS)
    assert "mine provides a task" in unusable_tasks()[name]
    rows = {row["what"]: row for row in json.loads(bench("doctor", "--json")[1])}
    assert rows[f"task {name!r}"]["found"] == "unusable"


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"value": "mine:other"}, "cannot be imported: AttributeError"),
        ({"value": "mine:Press.name"}, "it must be a subclass of tasks.base.Task, got a str"),
        ({"body": "    name = 'yours'\n"}, "the class must have the name 'mine'"),
        ({"before": "raise SystemExit(3)"}, "cannot be imported: SystemExit: 3"),
        ({"body": "    read = property()\n    from abc import abstractmethod\n"
          "    @abstractmethod\n    def more(self): ...\n"}, "the class lacks more"),
        ({"body": "    expert = None\n"}, "expert must be a method, got None: leave it out"),
        ({"body": "    changes = {'../heavy': None}\n"}, "cannot be called '../heavy': use 1 to"),
    ],
)  # fmt: skip
def test_a_class_that_is_no_task_is_refused_with_the_reason(install, bench, change, reason):
    install(**change)
    with pytest.raises(PackageError, match=reason):
        get_task("mine")
    code, _, error = bench("run", "smoke", "--tasks", "mine", "--out", "out")
    assert code == 2
    assert re.search(reason, error)


def test_a_package_that_ends_the_process_on_import_ends_no_command(install, bench):
    install(before="import os\nos._exit(5)")
    for words in (("run", "smoke", "--tasks", "mine", "--out", "out"), ("check-task", "mine")):
        code, _, error = bench(*words)
        assert code == 2
        assert "task 'mine' cannot be used: its process ended with exit code 5" in error


def test_an_expert_that_cannot_be_made_ends_no_command(install, bench):
    install("    def expert(self):\n        raise OSError('no file')\n")
    reason = "the expert of task 'mine' cannot be made: OSError: no file (mine.py:7 in expert)"
    for words in (("run", "smoke", "--tasks", "mine", "--out", "out"), ("describe", "mine")):
        code, _, error = bench(*words)
        assert code == 2
        assert f"task 'mine' cannot be used: {reason}" in error
    assert reason in bench("check-task", "mine")[1]
    rows = {row["what"]: row for row in json.loads(bench("doctor", "--json")[1])}
    assert reason in rows["task 'mine'"]["advice"]


def test_a_task_chooses_sizes_of_methods(install):
    from bench.selection import used_size
    from methods.registry import get_method

    install("    default_sizes = {'nn': 'median'}\n")
    study = study_of("paper", tasks="mine")
    assert used_size(study, get_method("nn"), "mine", {}) == "median"
    assert used_size(study, get_method("lstm"), "mine", {}) == "small"


def test_a_size_that_a_method_has_not_is_refused(install, bench):
    install("    default_sizes = {'nn': 'larg', 'of_another_package': 'small'}\n")
    code, _, error = bench("run", "smoke", "--tasks", "mine", "--methods", "nn", "--out", "out")
    assert code == 2
    assert "unknown size of nn in default_sizes of mine 'larg'" in error
    assert "did you mean 'large'?" in error


@pytest.mark.parametrize("name", ["script", "range", "task_", "component"])
def test_new_task_writes_a_task_that_works_under_any_name(tmp_path, monkeypatch, name):
    write_package("tasks.template", name, tmp_path / "source")
    monkeypatch.syspath_prepend(str(tmp_path / "source"))
    monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, name)
    written = importlib.import_module(name)
    kind = getattr(written, "".join(part.capitalize() for part in name.split("_")))
    for rule in ("declared", "expert_demonstrates"):
        RULES[rule](kind)


@pytest.mark.parametrize("name", ["Mine", "door", "kodex", "smoke", "random", "numpy"])
def test_new_task_refuses_unusable_names(bench, tmp_path, name):
    code, _, error = bench("new-task", name, "--folder", str(tmp_path))
    assert code == 2
    assert f"a task cannot be called {name!r}" in error
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_task_is_refused_with_the_nearest_name(bench):
    with pytest.raises(InputError, match="did you mean 'relocation'"):
        get_task("relocate")
    assert bench("check-task", "dor")[0] == 2


def test_the_example_on_the_shadow_hand_runs(site, bench, tmp_path):
    example = Path(__file__).parents[2] / "docs/examples/shadow"
    site.mkdir(exist_ok=True)
    shutil.copy(example / "shadow.py", site)
    noted = site / "shadow-1.0.dist-info"
    noted.mkdir()
    (noted / "METADATA").write_text("Metadata-Version: 2.1\nName: shadow\nVersion: 1.0\n")
    (noted / "entry_points.txt").write_text("[bench.tasks]\nshadow = shadow:Shadow\n")
    forget()
    out = tmp_path / "results"
    run = ("smoke", "--tasks", "shadow", "--methods", "nearest,expert", "--experiments", "success")
    code, _, err = bench("run", *run, "--episodes", "5", "--jobs", "1", "--out", str(out))
    assert code == 0, err
    assert set(Results(out).frame().method) == {"nearest", "expert"}
    code, printed, _ = bench("doctor")
    assert re.search(r"shadow: task of a package, with an expert", printed)


def test_a_task_with_the_name_of_a_method_is_refused(install, bench):
    install(name="kodex")
    code, _, err = bench("check-task", "kodex")
    assert code == 2
    assert "'kodex' of a package has the name of a method" in err


def test_results_of_a_task_that_is_no_longer_installed_say_so(site):
    with pytest.raises(InputError, match="known while its package is installed"):
        get_task("press")


def test_an_experiment_in_changed_physics_names_what_works_without(install, bench):
    install()
    code, _, err = bench("plan", "paper", "--tasks", "mine", "--out", "results")
    assert code == 2
    assert "--experiments sizes,success,ood,lifting,stability,efficiency leaves it out" in err
