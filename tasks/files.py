"""Arrays as bytes, and bytes on the disk."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load, save

_COMPLEX = "complex"
"""Metadata of a file: the names of complex arrays, stored as pairs of real numbers."""


def to_bytes(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Returns arrays by name as the content of a safetensors file, which `from_bytes` reads.

    The format has no complex numbers of double precision: they are stored as (..., 2).
    """
    plain = {name: np.asarray(array, order="C") for name, array in arrays.items()}
    paired = [name for name, array in plain.items() if array.dtype.kind == "c"]
    for name in paired:
        wide = plain[name].astype(np.complex128)
        plain[name] = np.stack([wide.real, wide.imag], axis=-1)
    return save(plain, metadata={_COMPLEX: json.dumps(paired)} if paired else None)


def from_bytes(content: bytes) -> dict[str, NDArray[Any]]:
    """Returns the arrays by name of the content of a safetensors file; they may be written to.

    Raises:
        safetensors.SafetensorError: it is no such content.
    """
    arrays = load(content)
    header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
    for name in json.loads(header.get("__metadata__", {}).get(_COMPLEX, "[]")):
        arrays[name] = arrays[name].view(np.complex128)[..., 0]
    return arrays


def flush(path: Path, content: bytes) -> None:
    """Writes a file, and waits until the disk has it."""
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
