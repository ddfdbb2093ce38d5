"""Films of stored methods, drawn and decoded."""

import os
import subprocess

import imageio_ffmpeg
import mujoco
import numpy as np
import pytest

from reports.video import RecordingPolicy, Take, _add_ghost, _camera
from tasks.experts import load_expert
from tasks.simulator import rollout

pytestmark = pytest.mark.skipif(
    not os.environ["MUJOCO_GL"], reason="MuJoCo cannot draw on this machine"
)
OBJECTS = {"tool": ("Object", "nail_board"), "relocation": ("Object",)}
CHOICE = ("--methods", "expert,kodex", "--start", "1")


@pytest.fixture
def results(bench, task, smoke, tmp_path):
    folder = tmp_path / "results"
    options = ("--experiments", "success", "--episodes", "3", "--jobs", "1")
    assert bench("run", "smoke", "--tasks", task.name, *options, "--out", str(folder))[0] == 0
    return folder


def pictures(path, height, width):
    decode = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(path)]
    raw = subprocess.run(
        [*decode, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True, check=True
    )
    return np.frombuffer(raw.stdout, np.uint8).reshape(-1, height, width, 3)


@pytest.mark.parametrize("task", ["door", "reorientation"], indirect=True)
def test_film_shows_each_method_from_start_to_end_and_is_on_the_page(bench, task, results):
    code, out, err = bench("video", task.name, "--results", str(results), *CHOICE)
    assert (code, err) == (0, "")
    path = results / "videos" / f"{task.name}-expert-kodex-s1-start-1.mp4"
    assert out.split() == [str(path)]
    film = pictures(path, 352, 640)
    assert len(film) == task.horizon + 25
    hand = [part.astype(int) for part in np.split(film[0][40:], 2, axis=1)]
    assert np.abs(hand[0] - hand[1]).max() > 30, "only KODex has a ghost"
    assert np.abs(film[0][40:].astype(int) - film[-1][40:]).max() > 60, "nothing moves"
    assert bench("report", str(results))[0] == 0
    assert "data:video/mp4;base64," in (results / "report" / "index.html").read_text()


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_default_films_show_one_success_and_one_failure(bench, task, results):
    code, out, _ = bench("video", task.name, "--results", str(results), "--methods", "kodex")
    assert code == 0
    names = [f"{task.name}-kodex-s1-{what}.mp4" for what in ("success", "failure")]
    assert out.split() == [str(results / "videos" / name) for name in names]


@pytest.mark.parametrize("task", ["tool", "relocation"], indirect=True)
def test_ghost_consists_of_the_hands_geoms_alone(task):
    data, scene = mujoco.MjData(task.model), mujoco.MjvScene(task.model, 1000)
    take = Take("kodex", task, task.model, np.zeros((1, task.model.nq)), None, True)
    _add_ghost(take, scene, data, np.zeros(task.robot_dim))
    added = scene.geoms[: scene.ngeom]
    seen = [geom for geom in added if geom.rgba[3] > 0]
    assert 20 < len(seen) < len(added)
    assert {geom.objtype for geom in seen} == {mujoco.mjtObj.mjOBJ_GEOM}
    bodies = {task.model.geom_bodyid[geom.objid] for geom in seen}
    assert not {task.model.body(name).id for name in OBJECTS[task.name]} & bodies


def on_screen(task, model, positions, bodies):
    """Returns the places of bodies (B, 2) in the square picture of a film, from -1 to 1."""
    data = mujoco.MjData(model)
    data.qpos = positions
    mujoco.mj_forward(model, data)
    scene, option = mujoco.MjvScene(model, 2000), mujoco.MjvOption()
    every = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, option, None, _camera(task.name, model), every, scene)
    eye = scene.camera[0]
    seen = data.xpos[bodies] - eye.pos
    right = np.cross(eye.forward, eye.up)
    depth = (seen @ eye.forward) * np.tan(np.radians(model.vis.global_.fovy / 2))
    return np.stack([seen @ right, seen @ eye.up], axis=1) / depth[:, None]


def test_hand_and_object_stay_in_the_picture(task):
    starts = task.sample("test", 3)
    manipulated = "latch" if task.name == "door" else "Object"
    root = task.model.body_rootid[task.model.jnt_bodyid[0]]
    arm = np.flatnonzero(task.model.body_rootid == root)
    hand = [body for body in arm if task.model.body(body).name not in ("forearm", "vive_tracker")]
    shown = [*hand, task.model.body(manipulated).id]
    for start in range(len(starts)):
        recorder = RecordingPolicy(load_expert(task).policy)
        rollout(task, starts[start : start + 1], recorder, threads=1, whole=True)
        for positions in recorder.positions[::10]:
            assert np.abs(on_screen(task, recorder.model, positions, shown)).max() < 1


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_method_without_results_is_refused(bench, task, results):
    code, _, err = bench("video", task.name, "--results", str(results), "--methods", "nn")
    assert code == 2
    assert "unknown method with results 'nn': choose from expert, kodex" in err
    code, _, err = bench("video", "tool", "--results", str(results), "--methods", "kodex")
    assert code == 2
    assert "no method has results on test starts of 'tool'" in err
    options = ("--methods", "kodex", "--seed", "7")
    code, _, err = bench("video", task.name, "--results", str(results), *options)
    assert code == 2
    assert "kodex has no results of seed 7 on door; it has 1" in err
    assert not (results / "videos").exists()


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_method_with_two_settings_is_filmed_with_both(bench, task, results):
    options = ("--experiments", "success", "--episodes", "3", "--jobs", "1", "--out", str(results))
    bench("run", "smoke", "--tasks", "door", "--set", "kodex.observables=1", *options)
    names = ("--methods", "kodex:observables=1,kodex", "--start", "1")
    assert bench("video", "door", "--results", str(results), *names)[0] == 0
    assert (
        len(pictures(results / "videos/door-kodex_observables=1-kodex-s1-start-1.mp4", 352, 640))
        == task.horizon + 25
    )
