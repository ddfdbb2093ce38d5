"""The same study in processes that find other processors than this one.

A mask acts on what a library sees, below the pins. What stands for the library's own choice, which
a pin replaces, is set only where nothing is pinned.
"""

import hashlib
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from methods.registry import SUITE
from tasks.pins import PINS, SWITCH, pin

PROGRAM = Path(__file__).with_name("tiny_study.py")
AVX_512 = "glibc.cpu.hwcaps=" + ",".join(f"-AVX512{part}" for part in ("F", "VL", "DQ", "BW", "CD"))
VENDOR = """
int mkl_serv_intel_cpu_true(void) { return INTEL; }
int mkl_serv_intel_cpu(void) { return INTEL; }
int mkl_serv_cpuiszen(void) { return !INTEL; }
"""
"""Replaces the functions by which MKL tells processors of Intel from those of AMD."""

pytestmark = pytest.mark.skipif(bool(pin().why_not), reason=f"not pinned: {pin().why_not}")


@dataclass(frozen=True)
class Mask:
    sees: dict[str, str] = field(default_factory=dict)
    """What libraries find, whether they are pinned or not."""
    chooses: dict[str, str] = field(default_factory=dict)
    """What they would choose for that processor."""


def wide_features() -> str:
    """NumPy's names of the AVX-512 features of this processor."""
    found = np._core._multiarray_umath.__cpu_features__
    return " ".join(name for name in ("X86_V4", "AVX512_ICL", "AVX512_SPR") if found.get(name))


def without_avx_512() -> Mask:
    chooses = {"OPENBLAS_CORETYPE": "Haswell", "ATEN_CPU_CAPABILITY": "avx2"}
    chooses |= {"ONEDNN_MAX_CPU_ISA": "AVX2", "NPY_DISABLE_CPU_FEATURES": wide_features()}
    return Mask({"GLIBC_TUNABLES": AVX_512, "MKL_ENABLE_INSTRUCTIONS": "AVX2"}, chooses)


def without_avx2() -> Mask:
    chooses = {"OPENBLAS_CORETYPE": "Sandybridge", "ATEN_CPU_CAPABILITY": "default"}
    return Mask({}, chooses | {"ONEDNN_MAX_CPU_ISA": "SSE41"})


@pytest.fixture(scope="module")
def other_vendor(tmp_path_factory):
    """MKL finds a processor of AMD where it is Intel's, and the other way round."""
    compiler = shutil.which("cc")
    if not compiler:
        pytest.skip("needs a C compiler")
    library = tmp_path_factory.mktemp("vendor") / "vendor.so"
    source = library.with_suffix(".c")
    source.write_text(VENDOR)
    intel = "GenuineIntel" in Path("/proc/cpuinfo").read_text()
    subprocess.run(
        [compiler, "-shared", "-fPIC", f"-DINTEL={int(not intel)}", source, "-o", library],
        check=True,
    )
    return Mask({"LD_PRELOAD": str(library)})


@pytest.fixture(scope="module")
def bits(tmp_path_factory):
    """Runs the study under a mask; returns the SHA-256 of each file that it leaves."""

    def run(mask: Mask, pinned: bool = True) -> dict[str, str]:
        folder = tmp_path_factory.mktemp("bits")
        kept = {name: value for name, value in os.environ.items() if name not in PINS}
        changed = mask.sees | ({} if pinned else {SWITCH: "off"} | mask.chooses)
        environment = kept | changed | {"BENCH_CACHE": str(folder / "cache")}
        command = [sys.executable, PROGRAM, folder / "results"]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        kinds = ("results/**/*.parquet", "**/*.safetensors", "results/tables/*")
        paths = {path for kind in kinds for path in folder.glob(kind)}
        return {
            str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(paths)
            if "_time" not in path.name
        }

    return run


@pytest.fixture(scope="module")
def here(bits):
    return bits(Mask())


def changed(one: dict[str, str], other: dict[str, str]) -> list[str]:
    assert {*one} == {*other}
    return [name for name in one if one[name] != other[name]]


def test_a_pinned_study_has_the_same_bits_on_another_processor(here, bits, other_vendor):
    elsewhere = Mask(without_avx_512().sees | other_vendor.sees)
    assert changed(here, bits(elsewhere)) == []
    assert sum(name.endswith("weights.safetensors") for name in here) == len(SUITE) + 1
    assert any("cache/demos" in name for name in here)
    assert any("expert" in name for name in here)


@pytest.mark.long
def test_without_pins_each_mask_changes_bits(bits, other_vendor):
    here = bits(Mask(), pinned=False)
    wide = [without_avx_512()] if wide_features() else []
    masks = (without_avx2(), other_vendor, *wide)
    found = [changed(here, bits(mask, pinned=False)) for mask in masks]
    for names in found:
        assert any(name.endswith("weights.safetensors") for name in names)
    assert any(name.endswith(".parquet") for names in found for name in names)


@pytest.mark.long
@pytest.mark.parametrize("instructions", ["AVX512", "AVX2", "SSE4_2"])
def test_mkl_computes_the_same_with_other_instructions(here, bits, other_vendor, instructions):
    seen = other_vendor.sees | {"MKL_ENABLE_INSTRUCTIONS": instructions}
    assert changed(here, bits(Mask(seen))) == []


@pytest.mark.long
def test_glibc_without_fma_counts_as_unpinned(here, bits):
    """Its functions cannot be pinned: the keys, and so the names, are those of no pins."""
    found = bits(Mask({"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX"}))
    assert not {name for name in found if name in here and "/cells/" in name}
