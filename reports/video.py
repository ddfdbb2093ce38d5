"""Films of methods side by side from one start, each with its planned motion as a ghost.

MuJoCo's renderer needs OpenGL without a screen, see `bench.renderer`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from PIL import Image, ImageColor, ImageDraw, ImageFont

from bench.checking import known
from bench.computing import make_policy
from bench.doing import say
from bench.jobs import stored_bytes
from bench.labels import EXPERT, labels_of
from bench.results import Results as StoredResults
from bench.rollout import TrackedMotion
from bench.verify import stored_cell
from reports.results import Results
from reports.style import colour, display
from tasks.base import Task
from tasks.data import FloatArray, Starts
from tasks.errors import InputError
from tasks.files import whole_file
from tasks.registry import get_task
from tasks.simulator import Policy, Simulator, rollout

Frame = NDArray[np.uint8]

SIZE, BAR = 320, 32
"""Pixels: sides of a picture, and height of the bar above it."""
RATE = 25
"""Pictures per second. Each is a control step of 10 ms: four times slower than real time."""
STILL = RATE
"""Pictures of the end, which show whether the method succeeded."""
VIEWS = {
    "tool": ((0.09, -0.18, 0.12), 0.8, 45.0),
    "door": ((0.19, -0.2, 0.36), 1.8, 45.0),
    "relocation": ((-0.09, -0.11, 0.21), 0.8, 45.0),
    "reorientation": ((0.04, -0.19, 0.2), 0.6, 60.0),
}
"""Point that the camera looks at, distance [m] and azimuth [degrees]. Other tasks are seen as their
model's file says, in ``<statistic center extent>`` and ``<visual><global azimuth elevation>``."""
GHOST = (0.1, 0.4, 0.9, 0.25)


@dataclass(frozen=True)
class Take:
    """One episode of a method."""

    method: str
    task: Task
    model: mujoco.MjModel
    """With the objects where the start puts them."""
    positions: FloatArray
    """(T, nq), of the whole scene."""
    planned: FloatArray | None
    """(T, H), of the hand's joints. None if the method does not plan."""
    success: bool


class RecordingPolicy:
    """A policy that records the positions of its one episode."""

    def __init__(self, policy: Policy) -> None:
        self.policy = policy
        self.positions: list[FloatArray] = []

    def reset(self, simulator: Simulator) -> None:
        """Starts the episode and keeps its model."""
        self.policy.reset(simulator)
        self.simulator = simulator
        self.model = simulator.batch.get_model(0)

    def act(self, simulator: Simulator, step: int) -> FloatArray:
        """Records the positions and acts."""
        self.positions.append(simulator.batch.qpos[0].copy())
        return self.policy.act(simulator, step)


def film(
    folder: Path, task_name: str, methods: Sequence[str], seed: int, start: int, path: Path
) -> None:
    """Writes an MP4 film of methods, fitted with the same seed, from one of its ``test`` starts.

    Args:
        folder: results of `bench run`.
        task_name: name of the task.
        methods: names, from left to right.
        seed: of the fits and of the start.
        start: index of the start.
        path: of the film.

    Raises:
        InputError: a method has no results of that seed on this task.
    """
    import imageio_ffmpeg

    task = get_task(task_name)
    starts = task.sample("test", start + 1, seed)[start:]
    say(f"simulating start {start} of {task_name}, seed {seed}")
    known_labels = list(_tested(Results(folder), task_name).method.unique())
    labels = [label for name in methods for label in labels_of(name, known_labels)]
    takes = [take(folder, task, label, starts) for label in labels]
    size = (SIZE * len(takes), SIZE + BAR)
    with whole_file(path) as temporary:
        writer = imageio_ffmpeg.write_frames(str(temporary), size, fps=RATE)
        writer.send(None)
        for number, frame in enumerate(frames(takes), 1):
            say(f"drawing picture {number} of {path.name}")
            writer.send(np.ascontiguousarray(frame))
        writer.close()


def lowest_seed(folder: Path, task_name: str, method: str) -> int:
    """Returns the lowest seed of a method with results on test starts of a task."""
    return int(_rows(Results(folder), task_name, method).seed.min())


def success_and_failure(folder: Path, task_name: str, method: str, seed: int) -> dict[str, int]:
    """Returns the first starts of ``test`` where a method with a seed succeeds and fails."""
    results = Results(folder)
    success = results.outcomes(_row(results, task_name, method, seed)).success.to_numpy(bool)
    found = {"success": np.flatnonzero(success), "failure": np.flatnonzero(~success)}
    return {name: int(starts[0]) for name, starts in found.items() if len(starts)}


def take(folder: Path, task: Task, method: str, starts: Starts) -> Take:
    """Returns the episode of a method, fitted with the seed of a start, from that start."""
    stored, results = StoredResults(folder), Results(folder)
    cell = stored_cell(stored, _row(results, task.name, method, starts.seed), 1)
    if cell.fit.method != EXPERT:
        known(cell.fit.method)  # importing the package may end the process
    policy = make_policy(cell, *stored_bytes(cell, stored))
    recorder = RecordingPolicy(policy)
    outcome = rollout(task, starts, recorder, threads=1, whole=True)
    positions = np.stack([*recorder.positions, recorder.simulator.batch.qpos[0]])
    planned = policy.motion[0] if isinstance(policy, TrackedMotion) else None
    return Take(method, task, recorder.model, positions, planned, bool(outcome.success[0]))


def frames(takes: Sequence[Take]) -> Iterator[Frame]:
    """Yields the pictures (SIZE + BAR, SIZE x methods, 3)."""
    renderers = [mujoco.Renderer(take.model, SIZE, SIZE) for take in takes]
    methods = [take.method for take in takes]
    shades = [colour(method, methods) for method in methods]
    last = max(len(take.positions) for take in takes) - 1
    for step in [*range(last + 1), *[last] * STILL]:
        ended = step == last
        whole = zip(takes, renderers, shades, strict=True)
        yield np.concatenate([_picture(*one, step, ended) for one in whole], axis=1)
    for renderer in renderers:
        renderer.close()


def _tested(results: Results, task: str) -> pd.DataFrame:
    """Returns the evaluations of all methods on test starts of a task."""
    found = results.rows.of_all(task=task, split="test")
    if found.empty:
        raise InputError(f"no method has results on test starts of {task!r}")
    return found


def _rows(results: Results, task: str, method: str) -> pd.DataFrame:
    tested = _tested(results, task)
    return tested[tested.method == labels_of(method, list(tested.method.unique()))[0]]


def _row(results: Results, task: str, method: str, seed: int) -> dict[str, Any]:
    found = _rows(results, task, method)
    if seed not in set(found.seed):
        have = ", ".join(map(str, sorted(found.seed)))
        raise InputError(f"{method} has no results of seed {seed} on {task}; it has {have}")
    return dict(found[found.seed == seed].to_dict("records")[0])


def _picture(take: Take, renderer: mujoco.Renderer, shade: str, step: int, ended: bool) -> Frame:
    step = min(step, len(take.positions) - 1)
    data = mujoco.MjData(take.model)
    data.qpos = take.positions[step]
    mujoco.mj_forward(take.model, data)
    renderer.update_scene(data, _camera(take.task.name, take.model))
    for effect in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
        renderer.scene.flags[effect] = 0
    if take.planned is not None:
        _add_ghost(take, renderer.scene, data, take.planned[step])
    picture = Image.new("RGB", (SIZE, SIZE + BAR), shade)
    picture.paste(Image.fromarray(renderer.render()), (0, BAR))
    text = display(take.method)
    if ended:
        text += ": success" if take.success else ": failure"
    draw = ImageDraw.Draw(picture)
    draw.text((8, 5), text, fill=_legible_on(shade), font=_font())
    return np.asarray(picture)


def _camera(task: str, model: mujoco.MjModel) -> mujoco.MjvCamera:
    """Returns a camera on the left behind the arm, above the table; or that of the model."""
    camera = mujoco.MjvCamera()
    if task in VIEWS:
        camera.lookat[:], camera.distance, camera.azimuth = VIEWS[task]
        camera.elevation = -35.0
    else:
        mujoco.mjv_defaultFreeCamera(model, camera)
    return camera


def _font() -> Any:
    return ImageFont.load_default(size=18)


def _legible_on(background: str) -> str:
    red, green, blue = ImageColor.getrgb(background)[:3]
    return "black" if 0.3 * red + 0.6 * green + 0.1 * blue > 128 else "white"


def _add_ghost(take: Take, scene: mujoco.MjvScene, data: mujoco.MjData, joints: FloatArray) -> None:
    """Adds a translucent hand at the planned joints."""
    model, before = take.model, scene.ngeom
    data.qpos[: take.task.robot_dim] = joints
    mujoco.mj_forward(model, data)
    option, perturb = mujoco.MjvOption(), mujoco.MjvPerturb()
    mujoco.mjv_addGeoms(model, data, option, perturb, mujoco.mjtCatBit.mjCAT_DYNAMIC, scene)
    arm = model.jnt_bodyid[0]
    for geom in scene.geoms[before : scene.ngeom]:
        # Sites are drawn as geoms too, but with other ids.
        of_hand = (
            geom.objtype == mujoco.mjtObj.mjOBJ_GEOM
            and model.body_rootid[model.geom_bodyid[geom.objid]] == model.body_rootid[arm]
        )
        geom.rgba = GHOST if of_hand else (0, 0, 0, 0)
