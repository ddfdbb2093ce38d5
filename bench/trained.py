"""Trained controllers that are shipped with the package or kept in the cache.

A controller takes minutes to train, and every method of a task needs it. It has two files: its
weights, and a card with its key, the SHA-256 of the weights, and when and where it was trained.
"""

import hashlib
import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.names import folder_name
from bench.spec import ControllerSpec
from tasks.cache import cache_folder, writable_cache
from tasks.errors import InputError
from tasks.files import whole_file

SHIPPED = Path(__file__).with_name("controllers")
_CACHE = "controllers"


@dataclass(frozen=True)
class TrainedController:
    """A controller that needs no training."""

    weights: bytes
    facts: Mapping[str, Any]
    """When and where it was trained, and how long that took."""


def trained(spec: ControllerSpec) -> TrainedController | None:
    """Returns the controller from the package or the cache; None if it must be trained.

    Damaged files are ignored.
    """
    for folder in (SHIPPED, cache_folder() / _CACHE):
        found = _read(folder / f"{file_name(spec)}.json", spec.key)
        if found:
            return found
    return None


def keep(spec: ControllerSpec, weights: bytes, facts: Mapping[str, Any]) -> None:
    """Stores a controller in the cache, or says on stderr that the cache is not writable."""
    try:
        write(writable_cache(_CACHE), spec, weights, facts)
    except (InputError, OSError) as error:  # the disk may be full
        print(f"bench: the controller {spec.label} is not kept: {error}", file=sys.stderr)


def write(folder: Path, spec: ControllerSpec, weights: bytes, facts: Mapping[str, Any]) -> None:
    """Writes the two files of a controller."""
    digest = hashlib.sha256(weights).hexdigest()
    card = {"key": spec.key, "weights_sha256": digest, "facts": facts}
    path = folder / f"{file_name(spec)}.json"
    with whole_file(path.with_suffix(".safetensors")) as data, whole_file(path) as text:
        data.write_bytes(weights)
        text.write_text(json.dumps(card, indent=1) + "\n")


def file_name(spec: ControllerSpec) -> str:
    """Returns the name of the two files of a controller, without endings."""
    return folder_name(spec.label, spec.key)


def _read(path: Path, key: str) -> TrainedController | None:
    """The controller of a card; None if its files are missing or damaged, or have another key."""
    try:
        card = json.loads(path.read_bytes())
        weights = path.with_suffix(".safetensors").read_bytes()
        sound = (card["key"], card["weights_sha256"]) == (key, hashlib.sha256(weights).hexdigest())
        return TrainedController(weights, dict(card["facts"])) if sound else None
    except (OSError, ValueError, KeyError, TypeError):
        return None
