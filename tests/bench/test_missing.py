"""`bench plan`, `status` and `run` agree on what is missing, whatever a results folder has lost."""

import shutil
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bench import jobs
from bench.backend import Workers
from bench.cli_status import progress
from bench.driver import run
from bench.plan import make_plan
from bench.presets import get_preset
from bench.results import Results
from bench.sealed_files import read_table, seal_table

KINDS = ("controllers", "fits", "evaluations", "episodes")
LOSSES = ("nothing", "removed", "damaged", "shortened")


@pytest.fixture
def study(smoke, monkeypatch):
    """Two seeds of NN at one size, KODex and the expert, in one changed physics."""
    monkeypatch.setattr("tasks.adroit.VARIATIONS", ("heavy_hand",))
    monkeypatch.setattr("bench.experiments.READINGS", {"door": ()})
    return replace(
        get_preset("smoke"),
        methods=("kodex", "nn"),
        seeds=(1, 2),
        episodes={"success": 7, "ood": 5, "stability": 2, "variants": 4, "controllers": 4},
        variants=("described",),
        settings={("nn", "epochs"): 1},
    )


@pytest.fixture
def counted(monkeypatch):
    """Counts the results of the jobs of a run; controllers are not cached and chunks are small."""
    made = dict.fromkeys(KINDS, 0)

    def watch(name, count):
        before = getattr(jobs, name)

        def noted(*arguments):
            for kind, number in count(*arguments).items():
                made[kind] += number
            return before(*arguments)

        monkeypatch.setattr(jobs, name, noted)

    watch("fit_controllers", lambda specs, *others: {"controllers": len(specs)})
    watch("fit_methods", lambda fits, *demos: {"fits": len(fits)})
    watch("evaluate", lambda cell, starts, *others: {"evaluations": 1, "episodes": len(starts)})
    monkeypatch.setattr("bench.plan.trained", lambda spec: None)
    monkeypatch.setattr("bench.runner.trained", lambda spec: None)
    monkeypatch.setattr("bench.missing.CHUNK", 3)
    return made


def lose(path, loss, left):
    """Damages a file of results."""
    if loss == "removed":
        path.unlink()
    elif loss == "damaged":
        path.write_bytes(path.read_bytes()[:-7])
    elif loss == "shortened" and path.suffix == ".parquet":
        table = read_table(path)
        count = int(left * table.num_rows)
        labels = {name.decode(): value.decode() for name, value in table.schema.metadata.items()}
        path.write_bytes(seal_table(table.slice(0, count).combine_chunks(), labels))


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_plan_status_and_run_agree_on_what_is_missing(
    task, study, counted, tmp_path, times, capsys
):
    whole = tmp_path / "whole"
    run(study, whole, Workers(1, "sequential"))
    paths = sorted(
        path.relative_to(whole)
        for place in ("cells", "controllers")
        for path in (whole / place).rglob("*")
        if path.is_file()
    )
    states = st.lists(
        st.tuples(st.sampled_from(LOSSES), st.floats(0, 1)),
        min_size=len(paths),
        max_size=len(paths),
    )
    draw = iter(range(10**6))

    @given(states)
    @settings(max_examples=5 * times, suppress_health_check=list(HealthCheck))
    def agree(state):
        folder = tmp_path / f"state {next(draw)}"
        shutil.copytree(whole, folder)
        for path, (loss, left) in zip(paths, state, strict=True):
            lose(folder / path, loss, left)
        made = make_plan(study, folder, 1)
        planned = {kind: getattr(made, f"missing_{kind}") for kind in KINDS}
        counts = progress(Results(folder))
        shown = {kind: counts[kind] - counts[f"{kind}_done"] for kind in KINDS[:3]}
        shown["episodes"] = counts["missing_episodes"]
        counted.update(dict.fromkeys(KINDS, 0))
        assert run(study, folder, Workers(1, "sequential")).failed == ()
        assert planned == shown == counted
        after = progress(Results(folder))
        assert after["missing_episodes"] == 0
        assert all(after[kind] == after[f"{kind}_done"] for kind in KINDS[:3])
        shutil.rmtree(folder)

    agree()
