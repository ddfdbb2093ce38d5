"""Options of `bench run`: what they accept and refuse."""

import json
from dataclasses import replace

import pytest

from bench.cores import cores
from bench.experiments import cells_of
from bench.parsing import settings
from bench.presets import get_preset

pytestmark = pytest.mark.parametrize("task", ["door"], indirect=True)


def test_options_accept_spaces_ranges_exponents_and_all_cores(task, smoke, bench, tmp_path):
    plain = ("--tasks", "door", "--methods", "kodex", "--experiments", "success,ood")
    plain += ("--seeds", "3", "--episodes", "10", "--jobs", str(cores()))
    other = ("--tasks", " door,", "--methods", "kodex ,kodex", "--experiments", "ood, success")
    other += ("--seeds", "1-2, 3", "--episodes", "1e1", "--jobs", "-1")
    plans = [
        json.loads(bench("plan", "smoke", *options, "--out", str(tmp_path), "--json")[1])
        for options in (plain, other)
    ]
    counts = ("cells", "missing_fits", "missing_evaluations", "missing_episodes", "memory_gib")
    assert plans[0]["missing_episodes"] == 3 * 2 * 10
    assert [plans[0][name] for name in counts] == [plans[1][name] for name in counts]


@pytest.mark.parametrize("written", ["64,32", "(64, 32)", "[64,32]"])
def test_a_tuple_may_be_set_with_or_without_brackets(task, smoke, written):
    (place, value), *_ = settings([f"ngf.hidden={written}"]).items()
    study = replace(get_preset("smoke"), methods=("ngf",), settings={place: value})
    study = replace(study, episodes={"success": 1})
    configs = [cell.fit.config for cell in cells_of(study, {"door": "key"})]
    assert [config["hidden"] for config in configs if config] == [[64, 32]]


@pytest.mark.parametrize(
    ("options", "answer"),
    [
        (("smok",), "did you mean 'smoke'"),
        (("smoke", "--tasks", "dor"), "did you mean 'door'"),
        (("smoke", "--methods", "kodx"), "did you mean 'kodex'"),
        (("smoke", "--tasks", "door, relocate"), "did you mean 'relocation'"),
        (("smoke", "--tasks", ","), "--tasks takes names separated by commas"),
        (("smoke", "--sizes", "singel"), "did you mean 'single'"),
        (
            ("smoke", "--sizes", "small"),
            "has the size 'small'; methods that have it: nn, lstm, ndp",
        ),
        (("smoke", "--variants", "publishd"), "choose from described"),
        (("smoke", "--variants", "described"), "presets with it: audit"),
        (("smoke", "--experiments", "suces"), "did you mean 'success'"),
        (
            ("smoke", "--experiments", "success,robustness"),
            "no experiment 'robustness': use paper or audit or beyond, or choose",
        ),
        (("smoke", "--experiments", "lifting"), "use quick or paper, or choose from"),
        (("smoke", "--seeds", "x"), "--seeds takes a number"),
        (("smoke", "--seeds", "0"), "--seeds takes a number"),
        (("smoke", "--episodes", "0"), "whole number from 1"),
        (("smoke", "--episodes", "1.5"), "got '1.5'"),
        (("smoke", "--jobs", "0"), "jobs must be 1 or more, or -1 for one per core, got"),
        (("smoke", "--jobs", "-2"), "jobs must be 1 or more"),
        (("smoke", "--backend", "lok"), "did you mean 'loky'"),
        (("smoke", "--limit", "nan"), "--limit must be above 0"),
        (("smoke", "--limit", "inf"), "--limit must be above 0, and finite, got inf"),
        (("smoke", "--set", "kodex"), "METHOD.FIELD=VALUE"),
        (("smoke", "--set", "kodex.observabls=2"), "did you mean 'observables'"),
        (("smoke", "--set", "kodx.observables=2"), "did you mean 'kodex'"),
        (("smoke", "--set", "nn.epochs=2"), "not among the methods of the run (kodex)"),
        (("smoke", "--set", "kodex.observables=9"), "choose from [1, 2, 3, 4]"),
        (("smoke", "--set", "kodex.cutoff=-1"), "cutoff must be 0 or more, got -1"),
        (
            ("smoke", "--methods", "ngf", "--set", "ngf.hidden=[64]"),
            "ngf.hidden takes tuple[int, int], got [64]; for example --set ngf.hidden=64,32",
        ),
        (
            ("smoke", "--methods", "nn", "--set", "nn.residual=yes"),
            "nn.residual takes bool, got 'yes'; for example --set nn.residual=true",
        ),
    ],
)
def test_run_refuses_bad_options_and_makes_no_folder(task, smoke, bench, tmp_path, options, answer):
    out = tmp_path / "results"
    code, said, error = bench("run", *options, "--out", str(out))
    assert (code, said) == (2, "")
    assert answer in error
    assert not out.exists()
