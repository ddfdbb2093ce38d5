"""Exports demonstrations to Minari's format and imports them from it (extra ``data``).

The import reads what `export_demos` writes, and the public Adroit data sets that Minari converted
from D4RL. Both store an episode's initial state as attributes ``options/initial_state_dict/...``.
The states of imported demonstrations come from a replay, not from the file.

Files are untrusted: nothing is unpickled or executed, no environment is built from metadata, links
and foreign filters are refused, and sizes are checked before anything is read.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import h5py
import minari
import numpy as np
from gymnasium import spaces
from minari.data_collector import EpisodeBuffer
from minari.dataset.minari_storage import MinariStorage

from tasks.arrays import Replay, Replayed
from tasks.base import Task
from tasks.components import Placed
from tasks.data import Demos, FloatArray, IntArray, Starts, real
from tasks.errors import InputError
from tasks.files import new_path, whole_folder
from tasks.recorder import record
from tasks.simulator import Simulator

MAX_EPISODES = 20_000
MAX_BYTES = 2**31
"""Largest total size of the arrays in a file, uncompressed."""
_INITIAL = "options/initial_state_dict/"
_FILTERS = (None, "gzip", "lzf")


@dataclass(frozen=True)
class _Episode:
    initial: dict[str, FloatArray]
    """qpos, qvel, and the parts in `Task.placed`."""
    actions: FloatArray
    """(T-1, A)"""


def export_demos(task: Task, demos: Demos, folder: Path) -> None:
    """Writes demonstrations as a Minari data set.

    Args:
        task: the task.
        demos: the demonstrations.
        folder: the new folder of the data set.

    Raises:
        InputError: the folder exists or cannot be created, or the task has no format of Minari's.
    """
    new_path(folder)
    initial = _initial_states(task, demos.starts)
    limits = spaces.Box(-1.0, 1.0, (task.layout.action_dim,), np.float64)
    seen = spaces.Box(-np.inf, np.inf, (task.layout.state_dim,), np.float64)
    with whole_folder(folder) as temporary:
        storage = MinariStorage.new(temporary / "data", observation_space=seen, action_space=limits)
        storage.update_episodes(
            _buffer(demos, row, {name: values[row] for name, values in initial.items()})
            for row in range(len(demos))
        )
        storage.update_metadata(
            {
                "dataset_id": f"{task.name}/expert-v0",
                "minari_version": minari.__version__,
                "task": task.name,
                "observation_names": [component.name for component in task.components],
            }
        )


def import_demos(task: Task, folder: Path) -> Replayed:
    """Replays the episodes of a Minari data set of the task's Adroit environment.

    Raises:
        InputError: the folder is not such a data set, an episode cannot be replayed, or the task
            has no format of Minari's.
    """
    episodes = _read_episodes(task, folder)
    values = np.stack([task.start_values(episode.initial) for episode in episodes])
    starts = Starts(task.name, "demo", np.arange(len(episodes)), values)
    success, demos = record(task, starts, _Replay(task, episodes))
    return Replayed(demos, success)


class _Replay(Replay):
    """Plays back actions from recorded initial states."""

    def __init__(self, task: Task, episodes: list[_Episode]) -> None:
        super().__init__(np.stack([episode.actions for episode in episodes]))
        self.task, self.episodes = task, episodes

    def reset(self, simulator: Simulator) -> None:
        """Sets the simulations to the initial states of their episodes."""
        super().reset(simulator)
        chosen = [self.episodes[i] for i in simulator.starts.index]
        batch = simulator.batch
        batch.qpos[:] = np.stack([episode.initial["qpos"] for episode in chosen])
        batch.qvel[:] = np.stack([episode.initial["qvel"] for episode in chosen])
        for placed in _placed(self.task):
            values = np.stack([episode.initial[placed.name] for episode in chosen])
            setattr(getattr(batch, placed.element)(placed.of), placed.attribute, values)
        simulator.refresh()


def _placed(task: Task) -> tuple[Placed, ...]:
    if not task.placed:
        raise InputError(
            f"no Minari format is known for {task.name!r}: its class defines no `placed` and"
            " `start_values`"
        )
    return task.placed


def _initial_states(task: Task, starts: Starts) -> dict[str, FloatArray]:
    batch = Simulator(task, starts).batch
    initial = {"qpos": batch.qpos.copy(), "qvel": batch.qvel.copy()}
    for placed in _placed(task):
        values = getattr(getattr(batch, placed.element)(placed.of), placed.attribute)
        initial[placed.name] = np.array(values)
    return initial


def _buffer(demos: Demos, row: int, initial: dict[str, FloatArray]) -> EpisodeBuffer:
    steps = demos.actions.shape[1]
    last = np.arange(steps) == steps - 1
    return EpisodeBuffer(
        options={"initial_state_dict": initial, "start": int(demos.starts.index[row])},
        observations=demos.states[row],
        actions=demos.actions[row],
        rewards=last.astype(np.float64),
        terminations=np.zeros(steps, np.bool_),
        truncations=last,
        infos={"hand_velocities": demos.velocities[row]},
    )


def _read_episodes(task: Task, folder: Path) -> list[_Episode]:
    file = folder / "data" / "main_data.hdf5"
    metadata = folder / "data" / "metadata.json"
    if not folder.exists():
        raise InputError(f"{folder} does not exist: name the folder of a Minari data set")
    if not file.is_file() or not metadata.is_file():
        raise InputError(
            f"{folder} is not a Minari data set in HDF5: it lacks {file} or {metadata}"
        )
    try:
        total = json.loads(metadata.read_text())["total_episodes"]
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{metadata} does not give the number of episodes, total_episodes"
        ) from error
    if type(total) is not int or not 0 < total <= MAX_EPISODES:
        raise InputError(f"{metadata}: total_episodes is {total!r}, allowed is 1 to {MAX_EPISODES}")
    try:
        with h5py.File(file, "r") as root:
            return _read_all(task, root, total)
    except InputError:
        raise
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise InputError(f"{file} cannot be read as HDF5: {error}") from error


def _read_all(task: Task, root: h5py.File, total: int) -> list[_Episode]:
    episodes = []
    budget = MAX_BYTES
    for number in range(total):
        episodes.append(_read_episode(task, _hard(root, f"episode_{number}", h5py.Group)))
        budget -= episodes[-1].actions.nbytes
        if budget < 0:
            raise InputError(f"{root.filename} holds more than {MAX_BYTES} bytes of actions")
    return episodes


def _read_episode(task: Task, group: h5py.Group) -> _Episode:
    widths = {"qpos": task.model.nq, "qvel": task.model.nv}
    widths |= {p.name: 4 if p.attribute == "quat" else 3 for p in _placed(task)}
    initial = {name: _attribute(group, _INITIAL + name, width) for name, width in widths.items()}
    actions = _hard(group, "actions", h5py.Dataset)
    steps, width = task.steps, task.layout.action_dim
    if actions.ndim != 2 or actions.shape[0] < steps or actions.shape[1] != width:
        raise InputError(
            f"{actions.name} has shape {actions.shape}: {task.name} needs at least"
            f" {steps} actions of {width} numbers"
        )
    plain = actions.dtype.kind in "fiu" and actions.compression in _FILTERS
    if not plain or actions.is_virtual or actions.external:
        raise InputError(f"{actions.name} is not a plain array of numbers inside the file")
    if actions.size * actions.dtype.itemsize > MAX_BYTES:
        raise InputError(f"{actions.name} has shape {actions.shape}: too large")
    return _Episode(initial, _finite(actions.name, actions[:steps]))


def _attribute(group: h5py.Group, name: str, width: int) -> FloatArray:
    if name not in group.attrs:
        raise InputError(f"{group.name} lacks the attribute {name!r}: it cannot be replayed")
    kind = group.attrs.get_id(name)
    if kind.dtype.kind not in "fiu" or kind.shape != (width,):
        raise InputError(f"{group.name}: attribute {name!r} must be {width} numbers")
    return _finite(f"{group.name}: attribute {name!r}", group.attrs[name])


def _finite(name: str, values: FloatArray | IntArray) -> FloatArray:
    wide = real(name, values)
    if not np.isfinite(wide).all():
        raise InputError(f"{name} holds numbers that are not finite")
    return wide


def _hard(group: h5py.Group, name: str, kind: type) -> h5py.Group | h5py.Dataset:
    """The member of a name and kind, if it is stored in this file rather than linked."""
    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        raise InputError(f"{group.name} has no {name!r} of its own")
    member = group[name]
    if not isinstance(member, kind):
        raise InputError(f"{member.name} must be a {kind.__name__.lower()}")
    return member
