"""Files of what a method has learnt, for a study that does not train it.

A file holds the arrays of `Method.parameters` in the safetensors format, and says what learnt them.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from safetensors import SafetensorError

from methods.base import Method, machine_fields
from methods.contract import checked_bytes, resolved
from tasks.errors import InputError
from tasks.files import from_bytes, labels_of, to_bytes, whole_file

_LEARNT_BY = "learnt_by"
"""Label of a file: what `_facts` returns, as JSON."""


@dataclass(frozen=True)
class Saved:
    """What a file holds."""

    file: Path
    parameters: bytes
    """The arrays alone, as results store them."""
    facts: Mapping[str, Any]
    """The method's name, its version, the dimensions of its task, and its config."""

    @cached_property
    def digest(self) -> str:
        """The SHA-256 of the arrays."""
        return hashlib.sha256(self.parameters).hexdigest()

    def check(self, method: Method, task: str) -> None:
        """Checks that a method has learnt it.

        Args:
            method: the method, not fitted.
            task: name of its task, for the message.

        Raises:
            InputError: another method has, another version of it, or one with another config or
                for a task of other dimensions.
        """
        ours = _facts(method)
        for what, wanted in ours.items():
            if self.facts[what] != wanted:
                theirs, mine = _differing(self.facts[what], wanted)
                cure = " (change the run with --sizes or --set)" if what == "config" else ""
                raise InputError(
                    f"{self.file} holds weights of another {what} than {method.name} on {task}:"
                    f" {theirs}, not {mine}{cure}"
                )


def save(method: Method, file: Path) -> None:
    """Writes what a fitted method has learnt to a file, which `read` reads.

    Raises:
        NotFittedError: the method has learnt nothing.
        ContractError: its parameters or its config cannot be stored.
    """
    arrays = from_bytes(checked_bytes(method.parameters(), "parameters"))
    facts = json.dumps(_facts(method), sort_keys=True)
    with whole_file(file) as place:
        place.write_bytes(to_bytes(arrays, **{_LEARNT_BY: facts}))


def read(file: Path) -> Saved:
    """Returns what a file holds. Nothing in it is executed.

    Raises:
        InputError: it cannot be read, or `save` has not written it.
    """
    try:
        content = file.read_bytes()
        arrays, facts = from_bytes(content), json.loads(labels_of(content)[_LEARNT_BY])
        return Saved(file, to_bytes(arrays), {name: facts[name] for name in _NAMES})
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}") from error
    except (SafetensorError, LookupError, TypeError, ValueError) as error:
        raise InputError(
            f"{file} is no file of weights: `bench.save_weights(method, FILE)` writes one"
        ) from error


def _facts(method: Method) -> dict[str, Any]:
    config, machine = resolved(method.config), machine_fields(method.config)
    decisive = {name: value for name, value in config.items() if name not in machine}
    return dict(
        zip(_NAMES, (method.name, method.version, asdict(method.layout), decisive), strict=True)
    )


_NAMES = ("method", "version", "dimensions", "config")


def _differing(one: Any, other: Any) -> tuple[str, str]:
    """Two values as text; of two dictionaries, the entries that differ."""
    if not (isinstance(one, dict) and isinstance(other, dict)):
        return repr(one), repr(other)
    names = [name for name in {**other, **one} if one.get(name) != other.get(name)]
    shown = [", ".join(f"{n}={found.get(n)!r}" for n in names) for found in (one, other)]
    return shown[0], shown[1]
