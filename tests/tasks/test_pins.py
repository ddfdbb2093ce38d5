import json
import os
import subprocess
import sys
from dataclasses import replace

import pytest

from bench.fits import fits_of
from bench.presets import PRESETS
from tasks import pins
from tasks.demos import demos_key, load_demos
from tasks.errors import InputError
from tasks.pins import PINS, SWITCH
from tasks.registry import get_task

pytestmark = pytest.mark.skipif(bool(pins.pin().why_not), reason="not pinned")
SHOW = """
import json, os, sys
from dataclasses import asdict
loaded = "numpy" in sys.modules
from tasks.pins import PINS, mark, pin
set_ = {name: os.environ.get(name) for name in PINS}
print(json.dumps(asdict(pin()) | {"mark": mark(), "loaded": loaded, "set": set_}))
"""


@pytest.fixture
def state():
    """What a new process says of its pins after some lines of Python."""

    def found(lines: str = "", **environment: str) -> dict:
        kept = {name: value for name, value in os.environ.items() if name not in PINS}
        command = [sys.executable, "-c", f"{lines}\n{SHOW}"]
        done = subprocess.run(command, env=kept | environment, capture_output=True, check=True)
        return json.loads(done.stdout)

    return found


@pytest.mark.parametrize("package", ["bench", "methods", "reports", "tasks"])
def test_each_package_pins_before_numpy_is_loaded(state, package):
    found = state(f"import {package}")
    assert (found["mark"], found["set"]) == ("x86-64-v3", PINS)
    assert not found["loaded"]


@pytest.mark.parametrize("value", ["off", " Off ", "0"])
def test_pinning_can_be_switched_off(state, value):
    found = state(**{SWITCH: value})
    assert found["mark"] == "unpinned"
    assert found["why_not"] == "BENCH_PINS switches it off"
    assert set(found["set"].values()) == {None}


def test_an_empty_variable_is_as_one_that_is_not_set(state):
    empty = dict.fromkeys((SWITCH, "NPY_DISABLE_CPU_FEATURES", "ONEDNN_MAX_CPU_ISA"), "")
    found = state(**empty)
    assert (found["mark"], found["set"]) == ("x86-64-v3", PINS)


@pytest.mark.parametrize("value", ["disabled", "offf"])
def test_an_unknown_value_of_the_switch_is_refused(value, monkeypatch, bench):
    monkeypatch.setenv(SWITCH, value)
    answer = f"unknown value of BENCH_PINS '{value}': choose from on, 1, yes, true, off, 0"
    with pytest.raises(InputError, match=answer):
        load_demos(get_task("door"))
    code, said, error = bench("list")
    assert (code, said) == (2, "")
    assert answer in error


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ((SWITCH, "off"), "BENCH_PINS switches it off"),
        (("MKL_CBWR", "AVX2"), "MKL_CBWR is AVX2, not COMPATIBLE: unset it"),
        (("MKL_CBWR", ""), "MKL_CBWR is no longer set"),
    ],
)
def test_a_change_of_the_environment_after_the_import_is_refused(change, reason, monkeypatch):
    pins.check_environment()
    monkeypatch.setenv(*change)
    answer = rf"environment has changed since \({reason}\): set .* before the import"
    with pytest.raises(InputError, match=answer):
        pins.check_environment()
    monkeypatch.undo()
    monkeypatch.setattr(pins, "pin", lambda: pins.State("BENCH_PINS switches it off", late=False))
    with pytest.raises(InputError, match=r"\(no longer: BENCH_PINS switches it off\)"):
        pins.check_environment()


def test_a_variable_that_the_user_has_set_is_kept_and_named(state):
    found = state(MKL_CBWR="AVX2")
    assert found["mark"] == "unpinned"
    assert found["why_not"] == "MKL_CBWR is AVX2, not COMPATIBLE: unset it"
    assert [*filter(None, found["set"].values())] == ["AVX2"]


@pytest.mark.parametrize(
    ("tunables", "mark"),
    [("-AVX2,-FMA", "unpinned"), ("-AVX2_Usable", "unpinned"), ("-AVX512F", "x86-64-v3")],
)
def test_masks_of_glibc_count_if_they_change_its_functions(state, tunables, mark):
    assert state(GLIBC_TUNABLES=f"glibc.cpu.hwcaps={tunables}")["mark"] == mark


def test_a_process_that_had_loaded_numpy_pins_only_those_that_it_starts(state):
    found = state("import numpy")
    assert found["late"]
    assert (found["mark"], found["set"]) == ("x86-64-v3", PINS)
    assert not state("import numpy", **PINS)["late"]


def test_a_processor_without_avx2_and_fma_is_named(monkeypatch):
    monkeypatch.setattr(
        pins, "processor", lambda: ("Old", frozenset(pins.NEEDED) - {"avx2", "fma"})
    )
    assert pins.why_not() == "this processor lacks avx2, fma"


def test_what_would_get_another_mark_is_not_computed(monkeypatch):
    with pytest.raises(
        InputError, match=r"marked unpinned cannot be computed here: kernels are pi"
    ):
        pins.check_mark("unpinned")
    monkeypatch.setattr(pins, "pin", lambda: pins.State("", late=True))
    with pytest.raises(InputError, match="was loaded before kodex-bench"):
        pins.check_mark("x86-64-v3")


def test_unpinned_fits_have_other_keys():
    (fit,) = fits_of(PRESETS["smoke"], "door", "kodex", "single")
    changed = replace(fit, pins="unpinned")
    assert fit.pins == "x86-64-v3"
    assert changed.key != fit.key


def test_a_label_does_not_name_demonstrations_of_the_expert_whatever_the_kernels():
    (fit,) = fits_of(PRESETS["smoke"], "door", "kodex", "single")
    key = demos_key(get_task("door"), pins="unpinned")
    assert key != fit.demos_key
    assert replace(fit, pins="unpinned", demos_key=key).label == fit.label


@pytest.mark.long
def test_demonstrations_are_recorded_elsewhere_if_numpy_came_first(monkeypatch, tmp_path):
    monkeypatch.setenv("BENCH_CACHE", str(tmp_path))
    monkeypatch.setattr("tasks.demos.pin", lambda: pins.State("", late=True))
    monkeypatch.setattr("tasks.demos.make_demos", lambda *_: pytest.fail("recorded here"))
    assert len(load_demos(get_task("door"))) == 250
