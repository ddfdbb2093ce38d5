"""Arrays as bytes, and bytes on the disk."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save


def to_bytes(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Returns arrays by name as the content of a safetensors file."""
    return save({name: np.ascontiguousarray(array) for name, array in arrays.items()})


def flush(path: Path, content: bytes) -> None:
    """Writes a file, and waits until the disk has it."""
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
