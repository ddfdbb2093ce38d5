"""Chunk: behaviour cloning of the next C actions, of which the first few are taken.

A policy that decides seldom has fewer occasions to leave what was demonstrated, and one that
decides often corrects sooner (Zhao et al., "Learning Fine-Grained Bimanual Manipulation with
Low-Cost Hardware", 2023). It is not in the paper.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from methods.action_network import ActionConfig
from methods.base import check_above
from methods.bc import BC
from tasks.data import Layout
from tasks.errors import InputError


@dataclass(frozen=True, kw_only=True)
class ChunkConfig(ActionConfig):
    """The settings of chunks.

    Raises:
        InputError: more actions are taken than a chunk has.
    """

    length: int = 8
    """C, the number of actions in a chunk."""
    horizon: int = 4
    """How many of them are taken before the next chunk."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_above(self, 0, "length", "horizon")
        if self.horizon > self.length:
            raise InputError(f"horizon must be at most length, {self.length}, got {self.horizon}")


class Chunk(BC):
    """C actions for each state; the state is looked at every `horizon` steps."""

    name = "chunk"
    summary = "behaviour cloning of chunks of actions"
    sizes: ClassVar[Mapping[str, Any]] = {
        "small": ChunkConfig(hidden=(128, 128)),
        "median": ChunkConfig(hidden=(256, 256)),
        "large": ChunkConfig(hidden=(512, 512)),
    }

    def __init__(self, config: ChunkConfig, layout: Layout) -> None:
        super().__init__(config, layout)
        self.length, self.horizon = config.length, config.horizon
