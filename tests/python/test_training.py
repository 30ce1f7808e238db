# SPDX-License-Identifier: Apache-2.0
"""Scenes, models and training from Python, on a scene that is made here: a ball on a wall, seen by four cameras."""
import gc
import os
import signal
import subprocess
import sys
import threading
import warnings

import numpy as np
import pytest

import gflow

pytestmark = pytest.mark.skipif(not hasattr(gflow, "train"), reason="built without OpenCV")
W, H, STEPS = 48, 36, 4
QUICK = {"init": {"from": "random", "count": 400}, "flow": {"enabled": True}, "quiet": True}


def cameras():
    K = np.array([[50, 0, W / 2], [0, 50, H / 2], [0, 0, 1.0]])
    poses = []
    for x in (-0.6, -0.2, 0.2, 0.6):
        pose = np.eye(4)
        pose[:3, 3] = -x, 0, 3
        poses.append(gflow.Camera(pose, K, W, H, f"cam{len(poses)}"))
    return poses


def picture(camera, t):
    """A red disc that moves to the right over a textured wall at z = 1."""
    x = np.arange(W) + 0.5 + 50 * camera.position[0] / 4
    y = np.arange(H) + 0.5
    x, y = np.meshgrid(x, y)
    wall = np.stack([0.5 + 0.3 * np.sin(x / 3), 0.5 + 0.3 * np.cos(y / 4), 0.4 + 0 * x], -1)
    ball = (x - W / 2 - 12 * (t - 0.5))**2 + (y - H / 2)**2 < 36
    return (255 * np.where(ball[..., None], [0.9, 0.1, 0.1], wall)).astype(np.uint8)


def scene_of_arrays(**more):
    times = np.linspace(0, 1, STEPS)
    views = [(camera, t) for camera in cameras() for t in times]
    splits = ["test" if camera.name == "cam1" else "train" for camera, _ in views]
    return gflow.Scene.of([picture(c, t) for c, t in views], [c for c, _ in views], [t for _, t in views], splits=splits,
                          **more)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The same scene as a folder: a transforms.json of nerfstudio, which has no time, so D-NeRF's."""
    import json
    import shutil
    root = tmp_path_factory.mktemp("scene")
    for split in ("train", "val", "test"):
        frames = []
        os.mkdir(root / split)
        for camera in cameras():
            if (camera.name == "cam1") != (split == "test") or split == "val":
                continue
            for k, t in enumerate(np.linspace(0, 1, STEPS)):
                name = f"{camera.name}_{k}"
                write_ppm(root / split / f"{name}.ppm", picture(camera, t))
                subprocess.run(["ffmpeg", "-v", "error", "-y", "-i", root / split / f"{name}.ppm",
                                root / split / f"{name}.png"], check=True)
                os.remove(root / split / f"{name}.ppm")
                pose = np.linalg.inv(camera.viewmat) @ np.diag([1, -1, -1, 1])
                frames.append({"file_path": f"./{split}/{name}", "time": t, "transform_matrix": pose.tolist()})
        with open(root / f"transforms_{split}.json", "w") as text:
            json.dump({"camera_angle_x": 2 * np.arctan(W / 100), "frames": frames}, text)
    yield root
    shutil.rmtree(root)


def write_ppm(path, image):
    with open(path, "wb") as file:
        file.write(b"P6 %d %d 255\n" % (image.shape[1], image.shape[0]) + image.tobytes())


@pytest.fixture(scope="module")
def trained():
    return gflow.train(scene_of_arrays(), iterations=60, **QUICK).model


def test_a_scene_of_arrays_has_its_views():
    scene = scene_of_arrays(points=[[0, 0, 1.0]], colors=[[1, 2, 3]])
    assert (len(scene.train), len(scene.test), scene.steps) == (12, 4, STEPS)
    assert len(scene.cameras) == 3
    view = next(view for view in scene.train if view.camera.name == "cam3" and view.step == 2)
    assert view.time == pytest.approx(2 / 3)
    np.testing.assert_array_equal(view.image(), picture(cameras()[3], 2 / 3))
    np.testing.assert_allclose(view.camera.viewmat, cameras()[3].viewmat)
    np.testing.assert_allclose(scene.points[0], [[0, 0, 1]])
    np.testing.assert_array_equal(scene.points[1], [[1, 2, 3]])


def test_a_scene_is_read_from_its_folder(folder):
    scene = gflow.Scene(folder)
    assert (len(scene.train), len(scene.test), scene.steps) == (12, 4, STEPS)
    view = min(scene.test, key=lambda view: view.time)
    np.testing.assert_array_equal(view.image()[..., :3], picture(cameras()[1], 0))
    half = gflow.Scene(folder, resolution=2)
    assert half.test[0].image().shape[:2] == (H // 2, W // 2)
    few = gflow.train(folder, scene={"max_steps": 2}, iterations=1, **QUICK)
    assert few.steps == 1
    assert (half.test[0].camera.width, half.test[0].camera.K[0, 0]) == (W // 2, pytest.approx(25))


@pytest.mark.parametrize("change, sentence", [
    ({"images": [np.zeros((H, W), np.uint8)]}, "image 0 is uint8 of shape"),
    ({"times": [0.0, 0.5]}, "argument 'times' has 2 entries"),
    ({"splits": ["all"]}, "expected train, test or val"),
    ({"points": [[0, 0, 1.0]], "colors": [[1, 2]]}, "arguments 'points' and 'colors'"),
    ({"points": [[0, 0, 1.0]], "colors": [[0.5, 0.5, 0.5]]}, "'colors' should be whole numbers"),
    ({"times": [1.5]}, "argument 'times' has 1.5, expected 0 to 1"),
])
def test_a_wrong_scene_of_arrays_is_explained(change, sentence):
    right = {"images": [picture(cameras()[0], 0)], "cameras": cameras()[:1], "times": [0.0]}
    with pytest.raises(gflow.Error, match=sentence):
        gflow.Scene.of(**{**right, **change})


def test_a_missing_scene_is_an_error_with_the_sentence_of_the_command():
    with pytest.raises(gflow.Error, match="cannot read .*nowhere: there is no such scene folder or video"):
        gflow.Scene("/nowhere")


def test_training_learns_and_tells_its_callback():
    steps, losses, models = [], [], []

    def callback(state):
        steps.append((state.step, state.steps, state.gaussians))
        losses.append(state.loss)
        assert state.terms["psnr"] > 0
        models.append(state.model)

    result = gflow.train(scene_of_arrays(), callback=callback, every=25, iterations=60, **QUICK)
    assert [step for step, _, _ in steps] == [25, 50, 60] and result.steps == 60
    assert all(gaussians == len(result.model) for _, _, gaussians in steps)
    view = scene_of_arrays().test[0]

    def error(model):
        return np.abs(model.render(view.camera, view.time).colors - view.image() / 255).mean()

    assert error(result.model) < 0.9 * error(models[0])
    assert error(models[-1]) == error(result.model)  # that of the last step


def test_a_callback_may_stop_and_may_fail(folder, tmp_path):
    result = gflow.train(scene_of_arrays(), callback=lambda state: state.step == 7, iterations=60, **QUICK)
    assert result.steps == 7

    def fails(state):
        if state.step == 3:
            raise LookupError("of the caller")

    with pytest.raises(LookupError, match="of the caller"):
        gflow.train(scene_of_arrays(), callback=fails, iterations=60, **QUICK)
    with pytest.raises(LookupError, match="of the caller"):
        gflow.train(folder, tmp_path / "run", callback=fails, iterations=60, **QUICK)
    assert gflow.Model.load(tmp_path / "run").state.startswith("iteration 3 ")  # saved before


def test_the_state_ends_with_its_callback():
    kept = []
    gflow.train(scene_of_arrays(), callback=kept.append, iterations=1, **QUICK)
    with pytest.raises(gflow.Error, match="inside of its callback only"):
        kept[0].model


def test_two_trainings_have_the_same_bits(trained):
    again = gflow.train(scene_of_arrays(), callback=lambda state: state.model.render(cameras()[0], 0.5) and None, every=20,
                        iterations=60, **QUICK).model
    assert len(again) == len(trained)
    for name, values in trained.parameters().items():
        np.testing.assert_array_equal(again.parameters()[name], values)


def test_a_run_is_that_of_the_command(folder, tmp_path):
    settings = ["--set", "init.from=random", "--set", "init.count=400", "--iterations", "30"]
    subprocess.run([gflow._program.program(), "--quiet", "train", folder, "-o", tmp_path / "command", *settings],
                   check=True, capture_output=True)
    result = gflow.train(folder, tmp_path / "python", iterations=30, **QUICK)
    ply = "point_cloud/iteration_30/point_cloud.ply"
    assert (tmp_path / "python" / ply).read_bytes() == (tmp_path / "command" / ply).read_bytes()
    assert result.metrics["test"]["psnr"] > 5
    assert os.path.exists(result.report) and result.run == str(tmp_path / "python")
    assert gflow.Model.load(result.run).state.startswith("iteration 30")
    with pytest.raises(gflow.Error, match="contains a finished run"):
        gflow.train(folder, tmp_path / "python", iterations=30, **QUICK)
    assert gflow.train(folder, tmp_path / "python", iterations=10, overwrite=True, **QUICK).steps == 10


def test_settings_that_do_not_exist_are_named():
    with pytest.raises(gflow.InputError, match="^(?!--set).*flow.wieght.*flow.weight"):
        gflow.train(scene_of_arrays(), flow={"wieght": 1})
    with pytest.raises(gflow.InputError, match="train.iterations"):
        gflow.train(scene_of_arrays(), iterations=-5)
    with pytest.raises(TypeError, match="'callback' is 5"):
        gflow.train(scene_of_arrays(), callback=5)
    with pytest.raises(TypeError, match="no argument 'iteration'.*train"):
        gflow.train(scene_of_arrays(), iteration=10)
    with pytest.raises(TypeError, match="given twice"):
        gflow.train(scene_of_arrays(), iterations=10, train={"iterations": 20})
    with pytest.raises(TypeError, match="give it to Scene"):
        gflow.train(scene_of_arrays(), resolution=2)
    with pytest.raises(gflow.Error, match="scene made of arrays"):
        gflow.train(scene_of_arrays(), "run")


def test_every_setting_is_listed():
    listed = {setting["name"]: setting for setting in gflow.settings()}
    assert listed["train.iterations"]["value"] == "20000" and "steps" in listed["train.iterations"]["meaning"]


def test_warnings_are_pythons(folder, tmp_path):
    with pytest.warns(RuntimeWarning, match="of one colour"):
        black = [np.zeros((H, W, 3), np.uint8)] * STEPS
        scene = gflow.Scene.of(black, cameras()[:1] * STEPS, np.linspace(0, 1, STEPS))
        gflow.train(scene, iterations=2, **QUICK)
    with pytest.warns(RuntimeWarning, match="motion.keys = 7 has no effect"):
        gflow.train(folder, tmp_path / "run", iterations=2, motion={"model": "spacetime", "keys": 7}, **QUICK)
    assert "motion.keys = 7" in (tmp_path / "run" / "notices.json").read_text()


@pytest.mark.parametrize("settings", [
    {"lr": {"motion": 50}},  # turns by up to 100 degrees
    {"lr": {"scales": 0.1}, "motion": {"model": "keyframes", "key_scales": True}},  # the longest axis becomes another
])
def test_a_model_at_a_time_is_what_it_renders(settings):
    trained = gflow.train(scene_of_arrays(), iterations=60, **settings, **QUICK).model
    camera, t, t2 = cameras()[2], 0.2, 0.8
    shown = trained.render(camera, t, t2)
    second = trained.at(t2)
    colors, alphas, meta = gflow.rasterization(
        **trained.at(t), viewmats=camera.viewmat[None], Ks=camera.K[None], width=W, height=H,
        near_plane=trained.near_plane, backgrounds=np.ones((1, 3)), render_mode="RGB+ED", stop="include",
        **{f"{name}_t2": second[name] for name in ("means", "quats", "scales")})
    np.testing.assert_allclose(colors[0, ..., :3], shown.colors, atol=1e-5)
    np.testing.assert_allclose(alphas[0], shown.alphas, atol=1e-5)
    np.testing.assert_allclose(meta["depth"][0], shown.depth, atol=1e-4)
    np.testing.assert_allclose(meta["flow"][0], shown.flow, rtol=1e-4, atol=1e-3)
    assert np.abs(shown.flow).max() > 0.01


@pytest.mark.parametrize("motion", ["nodes", "hexplane", "keyframes", "bases", "native4d"])
def test_every_motion_model_has_poses(motion):
    model = gflow.train(scene_of_arrays(), iterations=3, motion={"model": motion}, **QUICK).model
    assert model.motion == motion
    camera = cameras()[0]
    colors, _, _ = gflow.rasterization(**model.at(0.3), viewmats=camera.viewmat[None], Ks=camera.K[None], width=W,
                                       height=H, near_plane=model.near_plane, backgrounds=np.ones((1, 3)),
                                       stop="include")
    np.testing.assert_allclose(colors[0], model.render(camera, 0.3).colors, atol=1e-4)


def test_a_model_is_saved_and_loaded(trained, tmp_path):
    trained.save(tmp_path / "model.ply")
    again = gflow.Model.load(tmp_path / "model.ply")
    assert (again.motion, len(again), again.moving) == (trained.motion, len(trained), trained.moving)
    for name, values in trained.parameters().items():
        np.testing.assert_array_equal(again.parameters()[name], values)
    gflow.export(trained, tmp_path / "scene.html", compact=True)
    assert b"<!doctype html>" in (tmp_path / "scene.html").read_bytes()[:200].lower()
    gflow.export(trained, tmp_path / "moving.4dgs")  # it knows the scene's time steps
    gflow.export(trained, tmp_path / "now.ply")
    now = gflow.Model.load(tmp_path / "now.ply")
    np.testing.assert_array_equal(now.at(0)["means"], now.at(1)["means"])  # one time of it
    assert np.any(trained.at(0)["means"] != trained.at(1)["means"])
    gflow.export(tmp_path / "model.ply", tmp_path / "now.splat", times=0.25)
    assert len(gflow.Model.load(tmp_path / "now.splat")) <= len(trained)
    with pytest.raises(gflow.Error, match="cannot write .obj files"):
        trained.save(tmp_path / "model.obj")
    with pytest.raises(gflow.Error, match="no such run folder or splat file"):
        gflow.Model.load(tmp_path / "none.ply")


def test_wrong_cameras_and_times_are_explained(trained):
    camera = cameras()[0]
    with pytest.raises(gflow.InputError, match="'t' is 1.5, expected 0 to 1"):
        trained.render(camera, 1.5)
    with pytest.raises(gflow.InputError, match="matrix of 4 x 4"):
        trained.render(gflow.Camera(np.eye(3), camera.K, W, H), 0)
    with pytest.raises(gflow.InputError, match="viewmat"):
        trained.render(gflow.Camera(2 * np.eye(4), camera.K, W, H), 0)
    with pytest.raises(gflow.InputError, match="has 24 x 18 pixels"):
        trained.render(camera, 0, 1, camera_t2=camera.resized(W / 2, H / 2))
    with pytest.raises(gflow.InputError, match="near plane is at -1"):
        trained.render(camera, 0, near_plane=-1)
    with pytest.raises(TypeError, match="such as view.camera"):
        trained.render(scene_of_arrays().train[0], 0)
    with pytest.raises(TypeError, match="needs 't2'"):
        trained.render(camera, 0, camera_t2=camera)


class Mean(gflow.Objective):
    """Pulls the mean of the image to a grey, and remembers what it has seen."""
    name = "mean"
    channels = ("depth", "flow")

    def __init__(self, weight):
        self.weight, self.seen = weight, []

    def __call__(self, view):
        self.seen.append(view)
        difference = view.colors.mean() - 0.2
        return (self.weight * difference**2,
                {"colors": np.full_like(view.colors, 2 * self.weight * difference / view.colors.size)})


def test_an_objective_of_python_trains():
    camera = cameras()[0]
    objective, terms = Mean(300.0), []
    pulled = gflow.train(scene_of_arrays(), iterations=60, objectives=[objective], every=60,
                         callback=lambda state: terms.append(state.terms) and None, **QUICK).model
    free = gflow.train(scene_of_arrays(), iterations=60, **QUICK).model
    assert terms[0]["mean"] == pytest.approx(300 * (objective.seen[-1].colors.mean() - 0.2)**2)
    assert pulled.render(camera, 0.5).colors.mean() < free.render(camera, 0.5).colors.mean() - 0.1
    view = objective.seen[0]
    h, w = view.colors.shape[:2]
    assert view.depth.shape == (h, w, 1) and view.flow.shape == (h, w, 2) and view.step == 0
    whole = next(view for view in objective.seen if view.share == 1)
    shown = next(v for v in scene_of_arrays().train if v.name == whole.name)
    np.testing.assert_array_equal((whole.truth * 255).round().astype(np.uint8), shown.image())


@pytest.mark.parametrize("channel", ["colors", "alphas", "depth", "flow"])
def test_gradients_of_an_objective_reach_the_model(channel):
    """Its own loss alone: a step against the gradient lowers the loss."""
    class Weighted(gflow.Objective):
        channels = ("depth", "flow")
        values = []

        def __call__(self, view):
            image = getattr(view, channel)
            weights = np.random.default_rng(5).standard_normal(image.shape).astype(np.float32)
            self.values.append(float((weights * image).sum()))
            return self.values[-1], {channel: weights}

    objective = Weighted()
    objective.values = []
    camera = cameras()[0]
    times = np.linspace(0, 1, 2)
    scene = gflow.Scene.of([picture(camera, t) for t in times], [camera] * 2, times)
    settings = {"init": QUICK["init"], "quiet": True, "flow": {"enabled": False}, "train": {"focus": 0, "batch": 2}}
    gflow.train(scene, iterations=12, objectives=[objective], motion={"model": "spacetime"}, **settings)
    first, last = sum(objective.values[:2]), sum(objective.values[-2:])
    assert last < first - 0.02 * abs(first)


def test_a_wrong_objective_is_explained():
    class Bad(gflow.Objective):
        name = "bad"
        result = 3

        def __call__(self, view):
            return self.result

    bad = Bad()
    with pytest.raises(TypeError, match="objective 'bad' returned int"):
        gflow.train(scene_of_arrays(), iterations=2, objectives=[bad], **QUICK)
    bad.result = (1.0, {"colors": np.zeros(3)})
    with pytest.raises(gflow.Error, match="gradient 'colors' should have the shape of the image"):
        gflow.train(scene_of_arrays(), iterations=2, objectives=[bad], **QUICK)
    for result, sentence in (((1.0, {"colours": 0}), "no image 'colours'"), ((1.0, {"flow": 0}), "no image 'flow'"),
                             ((float("nan"), {}), "its loss is nan")):
        bad.result = result
        with pytest.raises(gflow.Error, match=sentence):
            gflow.train(scene_of_arrays(), iterations=2, objectives=[bad], **QUICK)
    for channels in (("normals",), "depth"):
        bad.channels = channels
        with pytest.raises(gflow.InputError, match="expected a tuple of 'depth' and 'flow'"):
            gflow.train(scene_of_arrays(), objectives=[bad])
    with pytest.raises(TypeError, match="not a gflow.Objective object"):
        gflow.train(scene_of_arrays(), objectives=[Bad])
    with pytest.raises(gflow.InputError, match="same name"):
        gflow.train(scene_of_arrays(), objectives=[Mean(1), Mean(2)])


def test_a_gradient_that_is_not_finite_is_explained():
    class Infinite(gflow.Objective):
        def __call__(self, view):
            return 1.0, {"colors": np.full_like(view.colors, np.inf)}

    with pytest.raises(gflow.Error, match="gradient 'colors' has a NaN or Inf"):
        gflow.train(scene_of_arrays(), iterations=2, objectives=[Infinite()], **QUICK)


def test_other_threads_run_while_training():
    counted, done = [0], threading.Event()

    def count():
        while not done.wait(0.001):
            counted[0] += 1

    thread = threading.Thread(target=count)
    thread.start()
    gflow.train(scene_of_arrays(), iterations=60, **QUICK)
    done.set()
    thread.join()
    assert counted[0] > 20


def test_ctrl_c_ends_a_training_and_keeps_the_run(folder, tmp_path):
    script = f"""
import gflow, os, signal
def callback(state):
    if state.step == 5:
        os.kill(os.getpid(), signal.SIGINT)
try:
    gflow.train({str(folder)!r}, {str(tmp_path / 'run')!r}, callback=callback, iterations=100000, quiet=True,
                init={{"from": "random", "count": 400}})
except KeyboardInterrupt as stop:
    print("stopped:", stop)
result = gflow.train({str(folder)!r}, {str(tmp_path / 'run')!r}, resume=True, quiet=True,
                     callback=lambda state: state.step == 8)
print(result.steps)
"""
    ended = subprocess.run([sys.executable, "-W", "ignore", "-c", script], capture_output=True, text=True, timeout=300)
    assert "stopped: interrupted after 5 of 100000 steps" in ended.stdout, ended.stdout + ended.stderr
    assert ended.stdout.split()[-1] == "8"


def test_optical_flow_follows_the_ball():
    camera = cameras()[0]
    flow, consistent = gflow.optical_flow(picture(camera, 0.4), picture(camera, 0.6))
    assert flow.shape == (H, W, 2) and consistent.dtype == bool
    red = picture(camera, 0.4)[..., 0] > 220
    assert np.median(flow[red][:, 0]) == pytest.approx(2.4, abs=0.6)
    with pytest.raises(gflow.InputError, match="expected the same"):
        gflow.optical_flow(np.zeros((4, 4, 3), np.uint8), np.zeros((5, 4, 3), np.uint8))


def test_an_experiment_is_a_table(folder, tmp_path):
    file = tmp_path / "two.toml"
    file.write_text(f"""
scenes = [{{ path = "{folder}", name = "ball" }}]
[settings]
train.iterations = 5
init.from = "random"
init.count = 200
[[axis]]
name = "flow"
choices = [{{ name = "off", flow.weight = 0 }}, {{ name = "on" }}]
""")
    rows = gflow.experiment(file, tmp_path / "two")
    assert [(row["scene"], row["flow"], row["seed"]) for row in rows] == [("ball", "off", 0), ("ball", "on", 0)]
    assert all(row["psnr"] > 5 and row["lpips"] is None for row in rows)
    assert (tmp_path / "two" / "report.html").exists()
    file.write_text("scenes = 3")
    with pytest.raises(gflow.Error, match="two.toml"):
        gflow.experiment(file, tmp_path / "two")


def test_the_example_of_research(tmp_path):
    pytest.importorskip("torch")
    example = os.path.join(os.path.dirname(__file__), "..", "..", "apps", "python", "examples", "research.py")
    ended = subprocess.run([sys.executable, "-W", "ignore", example, "", "60"], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    quality = {line.split(",")[0]: float(line.split()[-2]) for line in ended.stdout.splitlines() if "held-out" in line}
    assert quality["own motion"] > 20 and quality["own loss"] > 20, ended.stdout


def test_models_are_freed():
    import weakref
    model = gflow.train(scene_of_arrays(), iterations=1, **QUICK).model
    model.render(cameras()[0], 0)
    gone = weakref.ref(model)
    del model
    assert gone() is None  # without a collector of cycles
    gc.collect()
